/* What branches on an edge are, the class leaves to Python. */
static int arm_folds(const double *goal, const double *q, const double *near, const int *inside, double *miss, uint8_t *free)
{
    (void)goal, (void)q, (void)near, (void)inside, (void)miss, (void)free;
    return -1;
}
