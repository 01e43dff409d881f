/* One step of a Kalman filter for benchmarks/kalman.py, repeated; each sum from left to right, each operation a float. */

static void product(int rows, int inner, int columns, const float *a, const float *b, float *c)
{
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < columns; j++)
            c[i * columns + j] = a[i * inner] * b[j];
        for (int k = 1; k < inner; k++)
            for (int j = 0; j < columns; j++)
                c[i * columns + j] += a[i * inner + k] * b[k * columns + j];
    }
}

static void sum(int count, const float *a, const float *b, float *c)
{
    for (int i = 0; i < count; i++)
        c[i] = a[i] + b[i];
}

static void difference(int count, const float *a, const float *b, float *c)
{
    for (int i = 0; i < count; i++)
        c[i] = a[i] - b[i];
}

void steps(const float *Phi, const float *PhiT, const float *Q, const float *H, const float *HT, const float *R,
           const float *z, const float *identity, const float *x0, const float *P0, float *x, float *P, int count)
{
    static float T[N * N], V[N * N], W[N * N], PHt[N * M], K[N * M], HP[M * M], S[M * M], u[N], y[M], g[M];

    while (count-- > 0) {
        product(N, N, N, Phi, P0, T);
        product(N, N, N, T, PhiT, V);
        sum(N * N, V, Q, V);
        product(N, N, M, V, HT, PHt);
        product(M, N, M, H, PHt, HP);
        sum(M * M, HP, R, HP);
        float determinant = HP[0] * HP[3] - HP[1] * HP[2];
        S[0] = HP[3] / determinant;
        S[1] = -(HP[1] / determinant);
        S[2] = -(HP[2] / determinant);
        S[3] = HP[0] / determinant;
        product(N, M, M, PHt, S, K);
        product(N, N, 1, Phi, x0, u);
        product(M, N, 1, H, u, y);
        difference(M, z, y, g);
        product(N, M, 1, K, g, x);
        sum(N, u, x, x);
        product(N, M, N, K, H, T);
        difference(N * N, identity, T, W);
        product(N, N, N, W, V, P);
    }
}
