/* Chains of nodes with six unknowns each, eliminated from a block matrix: static condensation
   (Guyan, AIAA J. 3 (1965) 380), node by node as in Thomas' algorithm.

   A chain is the nodes 1 ... m between a = 0 and b = m + 1, which stay. It couples neighbours only:

       | A_aa  C_1                |      D_i: block (i, i),   U_i: block (i, i + 1),
       | B_1   D_1  U_1           |      L_i: block (i + 1, i).
       |       L_1  D_2  ...      |
       |            ...  D_m  U_m |      C_i: block (a, i) and B_i: block (i, a), both zero at first
       |                 L_m  A_bb|      for i > 1.

   Eliminating i leaves, with Y_i = D_i^-1 B_i and Z_i = D_i^-1 U_i,

       A_aa    -= C_i Y_i      C_{i+1} = -C_i Z_i
       B_{i+1}  = -L_i Y_i     D_{i+1} -= L_i Z_i,

   where D_{m+1} is A_bb, and C_{m+1}, B_{m+1} are the blocks (a, b), (b, a).

   Blocks here are stored by rows; PETSc's are stored by columns. The place of a block in an array
   is a number 2 p + t: the p-th block, as PETSc stores it or, with t = 1, its transpose. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#define N 6
#define NN 36
#define EACH(i) for (int i = 0; i < N; ++i)

/* The same source runs on any processor, and uses wider vectors where there are some. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif
#define INLINE static inline __attribute__((always_inline))

/* X = the block at a place of A, zero in the rows and columns that are held. */
INLINE void load(const double *A, int64_t place, const double *row, const double *column, double *X)
{
  const double *block = A + NN * (place >> 1);
  if (place & 1)
    EACH(i) EACH(j) X[N * i + j] = row[i] * column[j] * block[N * i + j];
  else
    EACH(i) EACH(j) X[N * i + j] = row[i] * column[j] * block[N * j + i];
}

/* C -= A B */
INLINE void take_product(const double *restrict A, const double *restrict B, double *restrict C)
{
  EACH(i) EACH(k)
  {
    const double a = A[N * i + k];
    EACH(j) C[N * i + j] -= a * B[N * k + j];
  }
}

/* y -= A x */
INLINE void take(const double *restrict A, const double *restrict x, double *restrict y)
{
  EACH(i) EACH(j) y[i] -= A[N * i + j] * x[j];
}

/* y -= A^T x */
INLINE void take_transposed(const double *restrict A, const double *restrict x, double *restrict y)
{
  EACH(i) EACH(j) y[j] -= A[N * i + j] * x[i];
}

/* D = P^T L R in place with reciprocal pivots, pivots chosen by size relative to the rows' own, and
   with it Y = D^-1 Y and Z = D^-1 Z. Returns 0 where D is singular. */
INLINE int eliminate(double *restrict D, const double *size, int32_t *swap, double *restrict Y,
                     double *restrict Z)
{
  double W[N][3 * N], scale[N];
  EACH(i)
  {
    memcpy(W[i], D + N * i, N * sizeof(double));
    memcpy(W[i] + N, Y + N * i, N * sizeof(double));
    memcpy(W[i] + 2 * N, Z + N * i, N * sizeof(double));
    scale[i] = 1.0 / size[i];
  }
  EACH(k)
  {
    int p = k;
    for (int i = k + 1; i < N; ++i)
      if (fabs(W[i][k]) * scale[i] > fabs(W[p][k]) * scale[p]) p = i;
    if (!(fabs(W[p][k]) > 0.0)) return 0;
    swap[k] = p;
    if (p != k)
    {
      for (int j = 0; j < 3 * N; ++j)
      {
        const double w = W[k][j];
        W[k][j] = W[p][j];
        W[p][j] = w;
      }
      const double s = scale[k];
      scale[k] = scale[p];
      scale[p] = s;
    }
    W[k][k] = 1.0 / W[k][k];
    for (int i = k + 1; i < N; ++i)
    {
      const double l = W[i][k] *= W[k][k];
      for (int j = k + 1; j < 3 * N; ++j) W[i][j] -= l * W[k][j];
    }
  }
  for (int k = N - 1; k >= 0; --k)
  {
    for (int j = N; j < 3 * N; ++j) W[k][j] *= W[k][k];
    for (int i = 0; i < k; ++i)
      for (int j = N; j < 3 * N; ++j) W[i][j] -= W[i][k] * W[k][j];
  }
  EACH(i)
  {
    memcpy(D + N * i, W[i], N * sizeof(double));
    memcpy(Y + N * i, W[i] + N, N * sizeof(double));
    memcpy(Z + N * i, W[i] + 2 * N, N * sizeof(double));
  }
  return 1;
}

/* x = D^-1 x */
INLINE void solve(const double *D, const int32_t *swap, double *x)
{
  EACH(k)
  {
    const double w = x[swap[k]];
    x[swap[k]] = x[k];
    x[k] = w;
  }
  EACH(i) for (int j = 0; j < i; ++j) x[i] -= D[N * i + j] * x[j];
  for (int i = N - 1; i >= 0; --i)
  {
    for (int j = i + 1; j < N; ++j) x[i] -= D[N * i + j] * x[j];
    x[i] *= D[N * i + i];
  }
}

/* Whether no entry of X is above a limit times the mean of the diagonal's in its row and column. */
INLINE int bounded(const double *X, const double *row, const double *column, double limit)
{
  int within = 1;
  EACH(i) EACH(j) within &= fabs(X[N * i + j]) <= limit * row[i] * column[j];
  return within;
}

/* V += X at a place. */
INLINE void add(const double *X, int64_t place, double *V)
{
  double *block = V + NN * (place >> 1);
  if (place & 1)
    EACH(i) EACH(j) block[N * j + i] += X[N * i + j];
  else
    EACH(i) EACH(j) block[N * i + j] += X[N * i + j];
}

/* Square roots of the diagonal's absolute values at some nodes, one for what is held: the size of
   each unknown. diagonal: place of each node's block. */
void sizes(int64_t nodes, const int64_t *node, const int64_t *diagonal, const double *A,
           const double *free, double *size)
{
  for (int64_t k = 0; k < nodes; ++k)
  {
    const double *D = A + NN * (diagonal[k] >> 1), *f = free + N * node[k];
    EACH(i) size[N * node[k] + i] = sqrt(fabs(f[i] * D[(N + 1) * i]) + 1.0 - f[i]);
  }
}

/* V += the blocks that stay; one on the diagonal of what is held. place, target: places in A and in
   V; row, column: the nodes of each block. */
WIDE
void keep(int64_t blocks, const int64_t *place, const int64_t *target, const int64_t *row,
          const int64_t *column, const double *A, const double *free, double *V)
{
  for (int64_t n = 0; n < blocks; ++n)
  {
    const double *r = free + N * row[n], *c = free + N * column[n];
    double X[NN];
    load(A, place[n], r, c, X);
    if (row[n] == column[n]) EACH(i) X[(N + 1) * i] += 1.0 - r[i];
    add(X, target[n], V);
  }
}

/* Eliminate chains, chain c of the inner nodes start[c] ... start[c + 1] - 1.

   node: of each chain a, 1 ... m, b. diagonal: place of D_i. up, low: of C_1, U_1 ... U_m and of
   B_1, L_1 ... L_m. corner: places in V of the blocks (a, a), (b, b), (a, b), (b, a). D, swap,
   Y, Z: what `forward` and `backward` need, and C and L, 0 where the matrix is symmetric, of which
   (b, a) is left out. A chain is unstable, and flagged so, where
   a block on the way is singular or an entry of A grows beyond a limit.

   Returns the number of unstable chains. */
WIDE
int64_t condense(int64_t chains, const int64_t *start, const int64_t *node,
                      const int64_t *diagonal, const int64_t *up, const int64_t *low,
                      const int64_t *corner, const double *A, const double *free,
                      const double *size, double limit, double *D, int32_t *swap, double *Y,
                      double *Z, double *C, double *L, double *V, int8_t *unstable)
{
  int64_t found = 0;
  for (int64_t c = 0; c < chains; ++c)
  {
    const int64_t first = start[c], m = start[c + 1] - first;
    const int64_t *n = node + first + 2 * c, *u = up + first + c, *l = low + first + c;
    const double *f_a = free + N * n[0], *s_a = size + N * n[0];
    double A_aa[NN] = {0}, C_i[NN], B_i[NN], D_i[NN];
    int well = 1;
    load(A, u[0], f_a, free + N * n[1], C_i);
    load(A, l[0], free + N * n[1], f_a, B_i);
    load(A, diagonal[first], free + N * n[1], free + N * n[1], D_i);
    EACH(i) D_i[(N + 1) * i] += 1.0 - free[N * n[1] + i];
    for (int64_t i = 1; i <= m && well; ++i)
    {
      const int64_t at = first + i - 1;
      const double *f = free + N * n[i], *f_next = free + N * n[i + 1];
      const double *s_next = size + N * n[i + 1];
      double L_i[NN], *D_k = D + NN * at, *Y_i = Y + NN * at, *Z_i = Z + NN * at;
      memcpy(D_k, D_i, sizeof D_i);
      memcpy(Y_i, B_i, sizeof B_i);
      load(A, u[i], f, f_next, Z_i);
      load(A, l[i], f_next, f, L_i);
      well = eliminate(D_k, size + N * n[i], swap + N * at, Y_i, Z_i);
      if (!well) break;
      if (C)
      {
        memcpy(C + NN * at, C_i, sizeof C_i);
        memcpy(L + NN * at, L_i, sizeof L_i);
      }
      memset(B_i, 0, sizeof B_i);
      memset(D_i, 0, sizeof D_i);
      if (i < m)
      {
        load(A, diagonal[at + 1], f_next, f_next, D_i);
        EACH(k) D_i[(N + 1) * k] += 1.0 - f_next[k];
      }
      double C_next[NN] = {0};
      take_product(C_i, Y_i, A_aa);
      take_product(C_i, Z_i, C_next);
      take_product(L_i, Y_i, B_i);
      take_product(L_i, Z_i, D_i);
      memcpy(C_i, C_next, sizeof C_i);
      well = bounded(D_i, s_next, s_next, limit) && bounded(A_aa, s_a, s_a, limit) &&
             bounded(C_i, s_a, s_next, limit);
    }
    unstable[c] = !well;
    found += !well;
    add(A_aa, corner[4 * c], V);
    add(D_i, corner[4 * c + 1], V);
    add(C_i, corner[4 * c + 2], V);
    if (C) add(B_i, corner[4 * c + 3], V);
  }
  return found;
}

/* g = what is left on the nodes that stay, and D_i^-1 g_i on the others. */
void forward(int64_t chains, const int64_t *start, const int64_t *node, const double *D,
             const int32_t *swap, const double *Y, const double *Z, const double *C,
             const double *L, double *g)
{
  for (int64_t c = 0; c < chains; ++c)
  {
    const int64_t *n = node + start[c] + 2 * c;
    for (int64_t at = start[c]; at < start[c + 1]; ++at)
    {
      double *g_a = g + N * n[0], *g_i = g + N * n[at - start[c] + 1];
      double *g_next = g + N * n[at - start[c] + 2], g_old[N];
      memcpy(g_old, g_i, sizeof g_old);
      solve(D + NN * at, swap + N * at, g_i);
      if (C)
      {
        take(C + NN * at, g_i, g_a);
        take(L + NN * at, g_i, g_next);
      }
      else /* C_i D_i^-1 = Y_i^T, L_i D_i^-1 = Z_i^T */
      {
        take_transposed(Y + NN * at, g_old, g_a);
        take_transposed(Z + NN * at, g_old, g_next);
      }
    }
  }
}

/* x_i = D_i^-1 g_i - Y_i x_a - Z_i x_{i+1} */
void backward(int64_t chains, const int64_t *start, const int64_t *node, const double *Y,
              const double *Z, double *x)
{
  for (int64_t c = 0; c < chains; ++c)
  {
    const int64_t *n = node + start[c] + 2 * c;
    for (int64_t at = start[c + 1] - 1; at >= start[c]; --at)
    {
      const int64_t i = at - start[c] + 1;
      take(Y + NN * at, x + N * n[0], x + N * n[i]);
      take(Z + NN * at, x + N * n[i + 1], x + N * n[i]);
    }
  }
}
