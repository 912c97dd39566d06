/* atan2 and tan as straight lines, so that a loop around them becomes vector instructions. Coefficients: S. L. Moshier,
   Cephes Mathematical Library (atan.c, tan.c); errors below 3e-16 of a result. */
ARM_INLINE double arm_fast_atan2(double y, double x)
{
    const double ax = fabs(x), ay = fabs(y);
    const double below = ay > ax ? ay : ax, above = ay > ax ? ax : ay;
    const int far = above > 0.66 * below; /* towards 45 degrees */
    const double up = far ? above - below : above;
    const double down = far ? above + below : below;
    const double t = up / (down > 0.0 ? down : 1.0);
    const double z = t * t;
    const double p = ((((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z
        - 7.500855792314704667340e1) * z - 1.228866684490136173410e2) * z - 6.485021904942025371773e1) * z;
    const double q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z
        + 4.328810604912902668951e2) * z + 4.853903996359136964868e2) * z + 1.945506571482613964425e2;
    const double near = t + t * (p / q);
    const double octant = far ? near + 0.7853981633974483 : near;
    const double quadrant = ay > ax ? 1.5707963267948966 - octant : octant;
    const double half = x < 0.0 ? ARM_PI - quadrant : quadrant;
    const double full = down == down ? half : down; /* not a number stays none */
    return copysign(full, y);
}

ARM_INLINE double arm_fast_tan(double x)
{
    const double k = rint(x * 0.6366197723675814);
    const double r = ((x - k * 1.570796310901641845703125) - k * 1.589325471229585673428e-8)
        - k * 6.12323399573676588614e-17;
    const double z = r * r;
    const double p = (-1.30936939181383777937e4 * z + 1.15351664838587416140e6) * z - 1.79565251976484877988e7;
    const double q = (((z + 1.36812963470692954678e4) * z - 1.32089234440210967447e6) * z
        + 2.50083801823357915839e7) * z - 5.38695755929454629881e7;
    const double t = r + r * (z * (p / q));
    const double odd = k - 2.0 * rint(0.5 * k);
    return odd != 0.0 ? -1.0 / t : t;
}

#define ARM_TAN(x) arm_fast_tan(x)
#define ARM_ATAN2(y, x) arm_fast_atan2(y, x)
