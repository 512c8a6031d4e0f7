/* Factorisation A = L S L^T of a symmetric matrix of 6 x 6 blocks, front by front (Duff & Reid, ACM
   Trans. Math. Softw. 9 (1983) 302; Liu, SIAM Rev. 34 (1992) 82). S has the signs of the pivots: of
   a definite matrix this is Cholesky's.

   The nodes are numbered in the order of their elimination and fall into parts of consecutive ones.
   A part's front are its own nodes and those later ones, its rows, that are coupled to them once all
   before is eliminated:

       | F_11       |     own: what is stored of the matrix and what children leave
       | F_21  F_22 |     rows: what children leave

   It is factorised, F_11 = L S L^T, M = F_21 L^-T S, and leaves F_22 - M S M^T to the part's parent,
   which is the one that its first row belongs to. What is left waits on a stack: parts come in
   postorder. Of a front (L, M) is kept, its panel, column by column; of symmetric matrices the lower
   half counts.

   No pivots are looked for. Of a definite matrix none are needed, for sums of squares of L's rows
   are its diagonal; of any other matrix L may grow, and is given up where it does.

   Products of dense matrices are BLAS's, whose functions are handed over by their addresses. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#define N 6
#define NN 36

/* Columns that are factorised at a time, before BLAS takes what they do to the others. */
#define BAND 48

typedef void Syrk(const char *, const char *, const int *, const int *, const double *,
                  const double *, const int *, const double *, double *, const int *);
typedef void Trsm(const char *, const char *, const char *, const char *, const int *, const int *,
                  const double *, const double *, const int *, double *, const int *);
typedef void Gemv(const char *, const int *, const int *, const double *, const double *,
                  const int *, const double *, const int *, const double *, double *, const int *);
typedef void Trsv(const char *, const char *, const char *, const int *, const double *, const int *,
                  double *, const int *);

/* F -= M S M^T, lower half, with the negative columns of M, (n, m), copied to w. */
static void take_square(int n, int m, const double *M, int lead, const double *sign,
                        const double *factor, double *F, int f_lead, double *w, Syrk *syrk)
{
  const double minus = -1.0, two = 2.0, one = 1.0;
  int negative = 0;
  if (!n) return;
  for (int j = 0; j < m; ++j)
    if (sign[j] < 0.0)
      memcpy(w + (size_t)n * negative++, M + (size_t)lead * j, sizeof(double) * n);
  syrk("L", "N", &n, &m, &minus, M, &lead, factor, F, &f_lead);
  if (negative) syrk("L", "N", &n, &negative, &two, w, &n, &one, F, &f_lead);
}

/* M = M L^-T S for the rows M below a factor L. */
static void divide(int n, int m, const double *L, int lead, const double *sign, double *M,
                   Trsm *trsm)
{
  const double one = 1.0;
  trsm("R", "L", "T", "N", &n, &m, &one, L, &lead, M, &lead);
  for (int j = 0; j < m; ++j)
    if (sign[j] < 0.0)
      for (int i = 0; i < n; ++i) M[i + (size_t)lead * j] *= -1.0;
}

/* F = L S L^T in place, the lower half of an (n, n) matrix; returns the number of negative signs,
   or -1 where F is singular. */
static int64_t cholesky(int n, double *F, int lead, double *sign, double *w, Syrk *syrk, Trsm *trsm)
{
  const double one = 1.0;
  int64_t negative = 0;
  for (int k = 0; k < n; k += BAND)
  {
    const int m = n - k < BAND ? n - k : BAND, rest = n - k - m;
    double *D = F + k + (size_t)lead * k;
    for (int j = 0; j < m; ++j)
    {
      double *l = D + (size_t)lead * j;
      const double d = l[j], root = sqrt(fabs(d));
      if (!(root > 0.0) || !isfinite(root)) return -1;
      const double s = sign[k + j] = d < 0.0 ? -1.0 : 1.0, scale = s / root;
      negative += d < 0.0;
      l[j] = root;
      for (int i = j + 1; i < m; ++i) l[i] *= scale;
      for (int c = j + 1; c < m; ++c)
      {
        double *y = D + (size_t)lead * c;
        const double x = s * l[c];
        for (int i = c; i < m; ++i) y[i] -= l[i] * x;
      }
    }
    if (!rest) break;
    divide(rest, m, D, lead, sign + k, D + m, trsm);
    take_square(rest, m, D + m, lead, sign + k, &one, D + m + (size_t)lead * m, lead, w, syrk);
  }
  return negative;
}

/* Whether no entry of L, (n, m), is above its limit: of its square, that of its row. */
static int bounded(int n, int m, const double *L, int lead, const double *limit)
{
  int within = 1;
  for (int j = 0; j < m; ++j)
  {
    const double *l = L + (size_t)lead * j;
    for (int i = 0; i < n; ++i) within &= l[i] * l[i] <= limit[i];
  }
  return within;
}

/* Add one child's columns begin ... end - 1 to a front of its parent, at columns `at` nodes earlier.
   place: of the child's rows in the parent's front. */
static void extend(const double *child, int64_t rows, const int64_t *place, int64_t begin,
                   int64_t end, double *front, int64_t lead, int64_t at)
{
  for (int64_t j = begin; j < end; ++j)
    for (int64_t c = 0; c < N; ++c)
    {
      const double *from = child + (N * j + c) * (N * rows);
      double *to = front + (N * (place[j] - at) + c) * lead - N * at;
      for (int64_t i = j; i < rows;)
      {
        /* Rows that are consecutive there as well. */
        int64_t last = i + 1;
        while (last < rows && place[last] == place[last - 1] + 1) ++last;
        const double *x = from + N * i;
        double *y = to + N * place[i];
        const int64_t n = N * (last - i);
        for (int64_t k = 0; k < n; ++k) y[k] += x[k];
        i = last;
      }
    }
}

/* Factorise.

   own, row: of each part, where its nodes and its rows begin, (parts + 1). place: of each row in
   the parent's front. children: how many each part has. panel: where each begins, (parts + 1).
   entry: where those of a part begin, (parts + 1), and of each entry source, 2 p + t for the p-th
   block or its transpose, and its row and column in the front. V: the blocks, by rows. size: of
   each unknown, the absolute value on the diagonal of A, of which `growth` times as much is the
   limit. With `leave`, the last part is assembled but not factorised. base and w are room, w for
   the limits of a front and for its panel.

   Returns the number of negative signs, or -1 where the matrix is singular or L grows. */
int64_t factorise(int64_t parts, const int64_t *own, const int64_t *row, const int64_t *place,
                  const int64_t *children, const int64_t *panel, const int64_t *entry,
                  const int64_t *source, const int64_t *at, const int64_t *column, int64_t leave,
                  const double *V, const double *size, double growth, const int64_t *below,
                  double *L, double *sign, double *stack, int64_t *base, double *w, int64_t syrk,
                  int64_t trsm)
{
  const double zero = 0.0;
  int64_t depth = 0, top = 0, negative = 0;
  for (int64_t s = 0; s < parts; ++s)
  {
    const int64_t nodes = own[s + 1] - own[s], rows = row[s + 1] - row[s];
    const int64_t lead = N * (nodes + rows);
    const int p = (int)(N * nodes), q = (int)(N * rows), n = (int)lead;
    double *F = L + panel[s], *left = stack + top;
    memset(F, 0, sizeof(double) * (size_t)(panel[s + 1] - panel[s]));
    for (int64_t e = entry[s]; e < entry[s + 1]; ++e)
    {
      const double *block = V + NN * (source[e] >> 1);
      double *to = F + N * column[e] * lead + N * at[e];
      if (source[e] & 1)
        for (int i = 0; i < N; ++i)
          for (int j = 0; j < N; ++j) to[i + lead * j] += block[N * j + i];
      else
        for (int i = 0; i < N; ++i)
          for (int j = 0; j < N; ++j) to[i + lead * j] += block[N * i + j];
    }
    /* Of each part on the stack, where it begins and its number. */
    const int64_t lowest = depth - children[s];
    for (int64_t k = lowest; k < depth; ++k)
    {
      const int64_t c = base[2 * k + 1], m = row[c + 1] - row[c];
      const int64_t *to = place + row[c];
      int64_t inside = 0;
      while (inside < m && to[inside] < nodes) ++inside;
      extend(stack + base[2 * k], m, to, 0, inside, F, lead, 0);
    }
    if (leave && s == parts - 1) break;
    double *signs = sign + N * own[s];
    const int64_t more = cholesky(p, F, n, signs, w, (Syrk *)syrk, (Trsm *)trsm);
    if (more < 0) return -1;
    negative += more;
    if (rows)
    {
      divide(q, p, F, n, signs, F + p, (Trsm *)trsm);
      take_square(q, p, F + p, n, signs, &zero, left, q, w, (Syrk *)syrk);
    }
    if (negative)
    {
      for (int i = 0; i < p; ++i) w[i] = growth * size[N * own[s] + i];
      for (int64_t i = 0; i < rows; ++i)
        for (int c = 0; c < N; ++c) w[p + N * i + c] = growth * size[N * below[row[s] + i] + c];
      if (!bounded(q, p, F + p, n, w + p)) return -1;
      for (int j = 0; j < p; ++j)
        if (!bounded(p - j, 1, F + j + (size_t)n * j, n, w + j)) return -1;
    }
    for (int64_t k = lowest; k < depth; ++k)
    {
      const int64_t c = base[2 * k + 1], m = row[c + 1] - row[c];
      const int64_t *to = place + row[c];
      int64_t inside = 0;
      while (inside < m && to[inside] < nodes) ++inside;
      extend(stack + base[2 * k], m, to, inside, m, left, q, nodes);
    }
    const int64_t start = children[s] ? base[2 * lowest] : top;
    if (left != stack + start) memmove(stack + start, left, sizeof(double) * (size_t)q * (size_t)q);
    depth = lowest;
    if (rows)
    {
      base[2 * depth] = start;
      base[2 * depth + 1] = s;
      ++depth;
    }
    top = start + (int64_t)q * q;
  }
  return negative;
}

/* x = L^-1 x, part by part, for several right-hand sides, each in the order of elimination; of the
   last part with `leave` nothing but what the others do to it. below: the node of each row. w: room
   for the largest front. */
void reduce(int64_t parts, const int64_t *own, const int64_t *row, const int64_t *below,
            const int64_t *panel, int64_t leave, const double *L, int64_t count, int64_t size,
            double *x, double *w, int64_t gemv, int64_t trsv)
{
  const double one = 1.0, zero = 0.0;
  const int step = 1;
  for (int64_t s = 0; s < parts - (leave != 0); ++s)
  {
    const int64_t rows = row[s + 1] - row[s];
    const int p = (int)(N * (own[s + 1] - own[s])), q = (int)(N * rows), n = p + q;
    const double *F = L + panel[s];
    for (int64_t k = 0; k < count; ++k)
    {
      double *y = x + k * size, *z = y + N * own[s];
      ((Trsv *)trsv)("L", "N", "N", &p, F, &n, z, &step);
      if (!rows) continue;
      ((Gemv *)gemv)("N", &q, &p, &one, F + p, &n, z, &step, &zero, w, &step);
      for (int64_t i = 0; i < rows; ++i)
        for (int c = 0; c < N; ++c) y[N * below[row[s] + i] + c] -= w[N * i + c];
    }
  }
}

/* x = L^-T S x, part by part from the last to the first; with `leave` the last one has its solution. */
void recover(int64_t parts, const int64_t *own, const int64_t *row, const int64_t *below,
             const int64_t *panel, int64_t leave, const double *L, const double *sign,
             int64_t count, int64_t size, double *x, double *w, int64_t gemv, int64_t trsv)
{
  const double one = 1.0, minus = -1.0;
  const int step = 1;
  for (int64_t s = parts - 1 - (leave != 0); s >= 0; --s)
  {
    const int64_t rows = row[s + 1] - row[s];
    const int p = (int)(N * (own[s + 1] - own[s])), q = (int)(N * rows), n = p + q;
    const double *F = L + panel[s];
    for (int64_t k = 0; k < count; ++k)
    {
      double *y = x + k * size, *z = y + N * own[s];
      for (int i = 0; i < p; ++i) z[i] *= sign[N * own[s] + i];
      if (rows)
      {
        for (int64_t i = 0; i < rows; ++i)
          memcpy(w + N * i, y + N * below[row[s] + i], N * sizeof(double));
        ((Gemv *)gemv)("T", &q, &p, &minus, F + p, &n, w, &step, &one, z, &step);
      }
      ((Trsv *)trsv)("L", "T", "N", &p, F, &n, z, &step);
    }
  }
}
