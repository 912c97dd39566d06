/* Cosines and sines of eight angles up to 1e5 rad, as one straight line, of which compilers make vectors. Coefficients:
   S. L. Moshier, Cephes Mathematical Library (sin.c). */
static void arm_turns(const double *ARM_RESTRICT q, double *ARM_RESTRICT cosine, double *ARM_RESTRICT sine)
{
    int i;
    for (i = 0; i < 8; i++) {
        const double k = rint(q[i] * 0.6366197723675814);
        const double r = ((q[i] - k * 1.570796310901641845703125) - k * 1.589325471229585673428e-8)
            - k * 6.12323399573676588614e-17;
        const double z = r * r;
        const double s = r + r * z * (((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z
            + 2.75573136213857245213e-6) * z - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z
            - 1.66666666666666307295e-1);
        const double c = 1 - z / 2 + z * z * (((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z
            - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z
            + 4.16666666666665929218e-2);
        const double half = rint(k / 2), odd = k - 2 * half; /* odd: -1, 0 or 1 quarter turns beside whole halves */
        const double sign = 1 - 2 * fabs(half - 2 * rint(half / 2));
        const double across = odd * sign, along = (1 - fabs(odd)) * sign;
        cosine[i] = along * c - across * s;
        sine[i] = along * s + across * c;
    }
}
