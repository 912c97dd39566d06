/* What branches on an edge are, the class leaves to Python. */
static int arm_folds(const double *goal, const double *q, double *miss)
{
    (void)goal, (void)q, (void)miss;
    return -1;
}
