/* Cholesky's factorisation of a matrix of 6 x 6 blocks, front by front (Duff & Reid, ACM Trans.
   Math. Softw. 9 (1983) 302; Liu, SIAM Rev. 34 (1992) 82).

   The nodes are numbered in the order of their elimination and fall into parts of consecutive ones.
   A part's front are its own nodes and those later ones, its rows, that are coupled to them once all
   before is eliminated:

       | F_11       |     own: what is stored of the matrix and what children leave
       | F_21  F_22 |     rows: what children leave

   It is factorised, F_11 = L L^T, M = F_21 L^-T, and leaves F_22 - M M^T to the part's parent, which
   is the one that its first row belongs to. What is left waits on a stack: parts come in postorder.
   Of a front (L, M) is kept, its panel, column by column; of symmetric matrices the lower half
   counts.

   Products of dense matrices are BLAS's, whose functions are handed over by their addresses. */

#include <stdint.h>
#include <string.h>

#define N 6
#define NN 36

typedef void Syrk(const char *, const char *, const int *, const int *, const double *,
                  const double *, const int *, const double *, double *, const int *);
typedef void Trsm(const char *, const char *, const char *, const char *, const int *, const int *,
                  const double *, const double *, const int *, double *, const int *);
typedef void Gemv(const char *, const int *, const int *, const double *, const double *,
                  const int *, const double *, const int *, const double *, double *, const int *);
typedef void Trsv(const char *, const char *, const char *, const int *, const double *, const int *,
                  double *, const int *);
typedef void Potrf(const char *, const int *, double *, const int *, int *);

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
   block or its transpose, and its row and column in the front. V: the blocks, by rows. With
   `leave`, the last part is assembled but not factorised.

   Returns 0, or where the matrix is not definite 1. */
int64_t factorise(int64_t parts, const int64_t *own, const int64_t *row, const int64_t *place,
                  const int64_t *children, const int64_t *panel, const int64_t *entry,
                  const int64_t *source, const int64_t *at, const int64_t *column, int64_t leave,
                  const double *V, double *L, double *stack, int64_t *base, int64_t syrk,
                  int64_t trsm, int64_t potrf)
{
  /* base: where on the stack what is left of each part begins; the top is at base[depth]. */
  const double one = 1.0, zero = 0.0, minus = -1.0;
  int64_t depth = 0, top = 0;
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
    /* The children are on the stack in the order of the parts, each followed by its number. */
    const int64_t lowest = depth - children[s];
    for (int64_t k = lowest; k < depth; ++k)
    {
      const int64_t c = base[2 * k + 1], m = row[c + 1] - row[c];
      const int64_t *to = place + row[c];
      int64_t inside = 0;
      while (inside < m && to[inside] < nodes) ++inside;
      extend(stack + base[2 * k], m, to, 0, inside, F, lead, 0);
    }
    if (!(leave && s == parts - 1))
    {
      int info = 0;
      ((Potrf *)potrf)("L", &p, F, &n, &info);
      if (info) return 1;
    }
    if (rows)
    {
      ((Trsm *)trsm)("R", "L", "T", "N", &q, &p, &one, F, &n, F + p, &n);
      ((Syrk *)syrk)("L", "N", &q, &p, &minus, F + p, &n, &zero, left, &q);
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
  return 0;
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

/* x = L^-T x, part by part from the last to the first; with `leave` the last one has its solution. */
void recover(int64_t parts, const int64_t *own, const int64_t *row, const int64_t *below,
             const int64_t *panel, int64_t leave, const double *L, int64_t count, int64_t size,
             double *x, double *w, int64_t gemv, int64_t trsv)
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
