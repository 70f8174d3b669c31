/* The n columns of a matrix; its smallest singular value over its largest takes the first place:
   Jacobi's rotations of the columns. */
static void spread(real *a, int n)
{
    real least = 0, largest = 0, nought = 0;
    int turned = 1;
    for (int i = 0; i < n * n; ++i) nought += a[i] * 0;
    for (int sweep = 0; sweep < 60 && turned; ++sweep) {
        turned = 0;
        for (int p = 0; p < n - 1; ++p)
            for (int q = p + 1; q < n; ++q) {
                real *u = a + p * n, *v = a + q * n;
                real uu = 0, vv = 0, uv = 0;
                for (int i = 0; i < n; ++i) {
                    uu += u[i] * u[i];
                    vv += v[i] * v[i];
                    uv += u[i] * v[i];
                }
                if (FABS(uv) > ROUNDING * SQRT(uu * vv)) {
                    const real z = (vv - uu) / (2 * uv);
                    const real t = (z < 0 ? -1 : 1) / (FABS(z) + SQRT(1 + z * z));
                    const real c = 1 / SQRT(1 + t * t), s = c * t;
                    turned = 1;
                    for (int i = 0; i < n; ++i) {
                        const real held = u[i];
                        u[i] = c * held - s * v[i];
                        v[i] = s * held + c * v[i];
                    }
                }
            }
    }
    for (int p = 0; p < n; ++p) {
        real square = 0;
        for (int i = 0; i < n; ++i) square += a[p * n + i] * a[p * n + i];
        if (p == 0 || square < least) least = square;
        if (p == 0 || square > largest) largest = square;
    }
    a[0] = SQRT(least) / SQRT(largest) + nought;
}
