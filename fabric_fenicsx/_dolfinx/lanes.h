/* What a kernel of FFCx needs to run for four cells at a time, one in each lane of a vector: numbers
   that calculate like a double, and what gathers them from fields and adds the result to an array.
   The kernel itself, and sizes of its own, are put in place of the lines that ask for them. */

#include <math.h>
#include <stdint.h>

#define LANES 4
#define INLINE static inline __attribute__((always_inline))
#define EACH for (int l = 0; l < LANES; ++l)

typedef double Numbers __attribute__((vector_size(8 * LANES)));
typedef int64_t Mask __attribute__((vector_size(8 * LANES)));

struct V
{
  Numbers r;
  V() = default;
  V(Numbers x) : r(x) {}
  V(double x) : r(x - Numbers{}) {}
};

INLINE V operator+(V a, V b) { return a.r + b.r; }
INLINE V operator-(V a, V b) { return a.r - b.r; }
INLINE V operator*(V a, V b) { return a.r * b.r; }
INLINE V operator/(V a, V b) { return a.r / b.r; }
INLINE V operator-(V a) { return -a.r; }
INLINE V &operator+=(V &a, V b) { a.r += b.r; return a; }

INLINE Mask operator<(V a, V b) { return a.r < b.r; }
INLINE Mask operator>(V a, V b) { return a.r > b.r; }
INLINE Mask operator<=(V a, V b) { return a.r <= b.r; }
INLINE Mask operator>=(V a, V b) { return a.r >= b.r; }
INLINE Mask operator==(V a, V b) { return a.r == b.r; }
INLINE Mask operator!=(V a, V b) { return a.r != b.r; }
INLINE V select(Mask which, V a, V b) { return which ? a.r : b.r; }
INLINE V select(bool which, V a, V b) { return which ? a : b; }

INLINE V fmax(V a, V b) { return a.r > b.r ? a.r : b.r; }
INLINE V fmin(V a, V b) { return a.r < b.r ? a.r : b.r; }

/* In a vector of its own: a lane of a V that is written to keeps it, and what follows, in memory. */
#define BY_LANES(f) INLINE V f(V a) { Numbers b; EACH b[l] = __builtin_##f(a.r[l]); return b; }
BY_LANES(sqrt) BY_LANES(fabs)
BY_LANES(exp) BY_LANES(log)
BY_LANES(sin) BY_LANES(cos) BY_LANES(tan) BY_LANES(asin) BY_LANES(acos) BY_LANES(atan)
BY_LANES(sinh) BY_LANES(cosh) BY_LANES(tanh) BY_LANES(erf)

INLINE V atan2(V a, V b) { Numbers c; EACH c[l] = __builtin_atan2(a.r[l], b.r[l]); return c; }
INLINE V pow(V a, V b) { Numbers c; EACH c[l] = __builtin_pow(a.r[l], b.r[l]); return c; }
INLINE V pow(V a, int n)
{
  V b = 1.0;
  for (int k = n < 0 ? -n : n; k; --k) b = b * a;
  return n < 0 ? 1.0 / b : b;
}

/* w = the values of a field in four cells, of the dofs that the table has for each. */
template <int dofs, int size>
INLINE void gather(V *w, int64_t values, int64_t table, const int64_t *cell)
{
  EACH for (int i = 0; i < dofs; ++i)
  {
    const double *from = (const double *)values + size * ((const int32_t *)table)[dofs * cell[l] + i];
    for (int k = 0; k < size; ++k) w[size * i + k].r[l] = from[k];
  }
}

/* b += the values of one lane, (dofs, size). */
template <int dofs, int size>
INLINE void scatter(const V *A, int l, const int32_t *row, double *b)
{
  for (int i = 0; i < dofs; ++i)
    for (int k = 0; k < size; ++k) b[size * row[i] + k] += A[size * i + k].r[l];
}

/* Blocks of a matrix += those of one lane, (dofs, size, dofs, size), each stored by columns where
   `place` says; not stored where that is negative. */
template <int dofs, int size>
INLINE void scatter_blocks(const V *A, int l, const int32_t *place, double *blocks)
{
  for (int i = 0; i < dofs; ++i)
    for (int j = 0; j < dofs; ++j)
    {
      const int64_t p = place[dofs * i + j];
      if (p < 0) continue;
      for (int r = 0; r < size; ++r)
        for (int s = 0; s < size; ++s)
          blocks[size * (size * p + s) + r] += A[dofs * size * (size * i + r) + size * j + s].r[l];
    }
}

static void kernel(V *__restrict A, const V *__restrict w, const double *__restrict c,
                   const V *__restrict coordinate_dofs)
{
  KERNEL
}

/* Add the kernel's results in some cells to an array.

   x, vertices: where the nodes are, and those of each cell. values, tables: addresses of each
   coefficient's values and of its table of dofs. c: constants. to: where results of a cell go,
   numbers of each in its row. */
void add(int64_t cells, int64_t x, int64_t vertices, const int64_t *values, const int64_t *tables,
         const double *c, const int32_t *to, double *array)
{
  for (int64_t first = 0; first < cells; first += LANES)
  {
    int64_t cell[LANES];
    /* What is too much in the last group is the last cell once more, and is not added. */
    EACH cell[l] = first + l < cells ? first + l : cells - 1;
    V w[WIDTH], nodes[6], A[ENTRIES] = {};
    gather<2, 3>(nodes, x, vertices, cell);
    GATHER
    kernel(A, w, c, nodes);
    for (int l = 0; l < LANES && first + l < cells; ++l)
      SCATTER(A, l, to + NUMBERS * cell[l], array);
  }
}
