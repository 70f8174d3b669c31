static int piece(const real *knots, int n, real x)
{
    int low = 0, high = n - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (knots[middle] <= x) low = middle; else high = middle;
    }
    return low;
}
