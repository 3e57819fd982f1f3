//! faer behind ndarray. Every matrix crosses as a slice, so no `unsafe` is needed.

mod decompositions;
mod gram;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::householder::{
    apply_block_householder_sequence_transpose_on_the_left_in_place_scratch as sequence_scratch,
    apply_block_householder_sequence_transpose_on_the_left_in_place_with_conj as apply_q_transpose,
    apply_block_householder_transpose_on_the_left_in_place_scratch as householder_scratch,
    apply_block_householder_transpose_on_the_left_in_place_with_conj as apply_reflections,
    make_householder_in_place,
};
use faer::linalg::lu::partial_pivoting as lu;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::qr::no_pivoting as qr;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::linalg::{cholesky::llt, triangular_solve};
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::traits::RealField;
use faer::traits::math_utils::one;
use faer::{Accum, Conj, MatMut, MatRef, Par};
use ndarray::{Array1, Array2, ArrayView2, Axis, CowArray, Ix2, ShapeBuilder, s};
use num_traits::Zero;
use pulp::{Simd, WithSimd};

use super::{BAND, Backend, CholeskySolve, Eigen, Failure, QrFactor, Svd};
use crate::simd::{Lanes, Level, Real};
use crate::threads;
use decompositions::{decompose, eigen, singular_values};
use gram::add_gram;

const PAR: Par = Par::Seq;

/// A copy laid out by columns, as the factorizations want it.
fn by_columns<A: Copy + Zero>(a: ArrayView2<'_, A>) -> Array2<A> {
    if a.t().is_standard_layout() {
        return a.to_owned();
    }
    let mut out = Array2::zeros(a.dim().f());
    let bands = out.axis_chunks_iter_mut(Axis(0), BAND);
    for (mut to, from) in bands.zip(a.axis_chunks_iter(Axis(0), BAND)) {
        for (mut to, from) in to.columns_mut().into_iter().zip(from.columns()) {
            to.assign(&from);
        }
    }
    out
}

/// The array itself where it is laid out by columns, else a copy that is.
fn into_columns<A: Copy + Zero>(a: Array2<A>) -> Array2<A> {
    if a.t().is_standard_layout() {
        a
    } else {
        by_columns(a.view())
    }
}

/// The array itself where it lies without gaps, else a copy that does.
fn gapless<A: Copy>(a: ArrayView2<'_, A>) -> CowArray<'_, A, Ix2> {
    if a.is_standard_layout() || a.t().is_standard_layout() {
        a.into()
    } else {
        a.as_standard_layout().into_owned().into()
    }
}

/// faer's view of a gapless array; a slice in either order is always there for one.
fn view<A>(a: ArrayView2<'_, A>) -> MatRef<'_, A> {
    let (rows, columns) = a.dim();
    if let Some(slice) = a.to_slice() {
        MatRef::from_row_major_slice(slice, rows, columns)
    } else {
        let slice = a.reversed_axes().to_slice().unwrap_or(&[]);
        MatRef::from_column_major_slice(slice, rows, columns)
    }
}

/// faer's mutable view of an array made by [`by_columns`].
fn view_mut<A>(a: &mut Array2<A>) -> MatMut<'_, A> {
    let (rows, columns) = a.dim();
    MatMut::from_column_major_slice_mut(
        a.as_slice_memory_order_mut().unwrap_or(&mut []),
        rows,
        columns,
    )
}

fn product<A: RealField + Copy + Zero>(a: ArrayView2<'_, A>, b: ArrayView2<'_, A>) -> Array2<A> {
    let mut out = Array2::zeros((a.nrows(), b.ncols()));
    if out.is_empty() {
        return out;
    }
    let (a, b) = (gapless(a), gapless(b));
    let (rows, columns) = out.dim();
    let work = rows.saturating_mul(columns).saturating_mul(a.ncols());
    let slab = rows.div_ceil(parts(work).min(rows / 32).max(1));
    let slice = out.as_slice_memory_order_mut().unwrap_or(&mut []);
    let (left, right) = (view(a.view()), view(b.view()));
    let slabs = slice.chunks_mut(slab * columns).enumerate().collect();
    threads::map(slabs, |(number, to): (usize, &mut [A])| {
        let rows = to.len() / columns;
        matmul(
            MatMut::from_row_major_slice_mut(to, rows, columns),
            Accum::Replace,
            left.subrows(number * slab, rows),
            right,
            one(),
            PAR,
        );
        clean(());
    });
    out
}

/// The number of parts into which `work` multiplications are cut.
fn parts(work: usize) -> usize {
    const MOST: usize = 16;
    (work / (4 * threads::WORTHWHILE)).clamp(1, MOST)
}

/// A matrix laid out by columns in which [`factorize`] has left its triangle and reflections, and their
/// factors.
fn factorized<A: RealField + Copy + Zero>(mut basis: Array2<A>) -> (Array2<A>, Array2<A>) {
    let (rows, columns) = basis.dim();
    let block = qr::factor::recommended_block_size::<A>(rows, columns);
    let mut factor = Array2::zeros((block, columns).f());
    let mut memory = MemBuffer::new(householder_scratch::<A>(rows, block, columns));
    let stack = MemStack::new(&mut memory);
    factorize(view_mut(&mut basis), view_mut(&mut factor), stack);
    (basis, factor)
}

/// The triangle that [`factorize`] leaves, by rows.
fn upper<A: Copy + Zero>(basis: &Array2<A>) -> Array2<A> {
    let columns = basis.ncols();
    let mut out = Array2::zeros((columns, columns));
    for first in (0..columns).step_by(BAND) {
        let band = first..columns.min(first + BAND);
        // What a band of columns holds above its own diagonal block is a rectangle.
        let place = s![..first, band.clone()];
        out.slice_mut(place).assign(&basis.slice(place));
        for column in band {
            let place = s![first..=column, column];
            out.slice_mut(place).assign(&basis.slice(place));
        }
    }
    out
}

/// Hands slabs of columns to `apply`, on several threads where `work` multiplications for each column are
/// worth it.
fn in_slabs<A: Send>(mut rest: MatMut<'_, A>, work: usize, apply: impl Fn(MatMut<'_, A>) + Sync) {
    let columns = rest.ncols();
    let most = parts(work.saturating_mul(columns)).min(columns / 48);
    let slab = columns.div_ceil(most.max(1)).max(1);
    let mut slabs = Vec::new();
    while rest.ncols() > slab {
        let (next, others) = rest.split_at_col_mut(slab);
        slabs.push(next);
        rest = others;
    }
    slabs.push(rest);
    threads::map(slabs, |slab| {
        apply(slab);
        clean(());
    });
}

fn triangularize<A: RealField + Copy + Zero + std::ops::Mul<Output = A>>(
    a: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> QrFactor<A> {
    let (rows, columns) = a.dim();
    let (basis, factor) = factorized(by_columns(a));
    let mut qtb = by_columns(b);
    in_slabs(view_mut(&mut qtb), 2 * rows * columns, |slab| {
        let scratch = sequence_scratch::<A>(rows, factor.nrows(), slab.ncols());
        let (basis, factor) = (view(basis.view()), view(factor.view()));
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        apply_q_transpose(basis, factor, Conj::No, slab, PAR, stack);
    });
    let residual_ss = qtb.slice(s![columns.., ..]).map_axis(Axis(0), |column| {
        column.iter().fold(A::zero(), |sum, &v| sum + v * v)
    });
    QrFactor {
        r: upper(&basis),
        qtb: qtb.slice(s![..columns, ..]).to_owned(),
        residual_ss,
    }
}

/// $A = QR$ in place, as many rows as columns or more: $R$ above the diagonal, below it and in
/// `factor` (shape (block size, columns)) the reflections as faer's functions apply them.
///
/// faer's own `qr_in_place` makes no reflection of a column that is left with less than
/// $16 \epsilon$ times the rows, and its $R$ keeps that remainder: hundreds of times rounding
/// error, in rows to which $Q^T B$ gives whole residuals. Here every column has its reflection, so
/// that what a dependent column leaves in $R$ is rounding error.
fn factorize<A: RealField>(mut a: MatMut<'_, A>, mut factor: MatMut<'_, A>, stack: &mut MemStack) {
    let (block, columns) = (factor.nrows(), a.ncols());
    for first in (0..columns).step_by(block) {
        let width = block.min(columns - first);
        let (_, from_diagonal) = a.rb_mut().split_at_row_mut(first);
        let (_, from_panel) = from_diagonal.split_at_col_mut(first);
        let (mut panel, rest) = from_panel.split_at_col_mut(width);
        let mut factor = factor.rb_mut().submatrix_mut(0, first, width, width);
        factorize_panel(panel.rb_mut(), factor.rb_mut(), stack);
        if rest.ncols() > 0 {
            let (panel, factor) = (panel.rb(), factor.rb());
            let (rows, block) = (panel.nrows(), panel.ncols());
            in_slabs(rest, 2 * rows * block, |slab| {
                let scratch = householder_scratch::<A>(rows, block, slab.ncols());
                let mut memory = MemBuffer::new(scratch);
                let stack = MemStack::new(&mut memory);
                apply_reflections(panel, factor, Conj::No, slab, PAR, stack);
            });
        }
    }
}

/// One block of columns, the left half before the right one.
fn factorize_panel<A: RealField>(
    mut a: MatMut<'_, A>,
    mut factor: MatMut<'_, A>,
    stack: &mut MemStack,
) {
    let width = a.ncols();
    if width == 1 {
        let (mut head, tail) = a.split_at_row_mut(1);
        let reflection = make_householder_in_place(&mut head[(0, 0)], tail.col_mut(0));
        factor[(0, 0)] = reflection.tau;
        return;
    }
    let half = width / 2;
    let (mut left, mut right) = a.rb_mut().split_at_col_mut(half);
    let (mut of_left, mut across, _, of_right) = factor.split_at_mut(half, half);
    factorize_panel(left.rb_mut(), of_left.rb_mut(), stack);
    apply_reflections(
        left.rb(),
        of_left.rb(),
        Conj::No,
        right.rb_mut(),
        PAR,
        stack,
    );
    let (_, mut right) = right.split_at_row_mut(half);
    factorize_panel(right.rb_mut(), of_right, stack);
    // The products of the left reflections' vectors with those of the right ones, whose upper
    // part is a unit triangle that R has the place of.
    let (_, left) = left.rb().split_at_row(half);
    let (left_top, left_bottom) = left.split_at_row(width - half);
    let (right_top, right_bottom) = right.rb().split_at_row(width - half);
    triangular::matmul(
        across.rb_mut(),
        BlockStructure::Rectangular,
        Accum::Replace,
        left_top.transpose(),
        BlockStructure::Rectangular,
        right_top,
        BlockStructure::UnitTriangularLower,
        one(),
        PAR,
    );
    matmul(
        across,
        Accum::Add,
        left_bottom.transpose(),
        right_bottom,
        one(),
        PAR,
    );
}

fn solve_upper<A: RealField + Copy + Zero>(
    r: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<Array2<A>, Failure> {
    if r.diag().iter().any(Zero::is_zero) {
        return Err(Failure::Pivot);
    }
    let mut x = by_columns(b);
    let r = gapless(r);
    triangular_solve::solve_upper_triangular_in_place(view(r.view()), view_mut(&mut x), PAR);
    Ok(x)
}

fn solve_square<A: RealField + Copy + Zero + PartialEq>(
    a: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<Array2<A>, Failure> {
    let n = a.nrows();
    let mut factor = by_columns(a);
    let mut x = by_columns(b);
    let (mut forward, mut backward) = (vec![0_usize; n], vec![0_usize; n]);
    let scratch = lu::factor::lu_in_place_scratch::<usize, A>(n, n, PAR, Default::default()).or(
        lu::solve::solve_in_place_scratch::<usize, A>(n, b.ncols(), PAR),
    );
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    let (_, permutation) = lu::factor::lu_in_place(
        view_mut(&mut factor),
        &mut forward,
        &mut backward,
        PAR,
        stack,
        Default::default(),
    );
    if factor.diag().iter().any(|pivot| *pivot == A::zero()) {
        return Err(Failure::Pivot);
    }
    let both = view(factor.view());
    lu::solve::solve_in_place(both, both, permutation, view_mut(&mut x), PAR, stack);
    Ok(x)
}

fn cholesky<A: RealField + Copy + Zero>(a: Array2<A>) -> Result<Array2<A>, Failure> {
    let mut factor = into_columns(a);
    let n = factor.nrows();
    let scratch = llt::factor::cholesky_in_place_scratch::<A>(n, PAR, Default::default());
    llt::factor::cholesky_in_place(
        view_mut(&mut factor),
        Default::default(),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| Failure::Pivot)?;
    Ok(factor)
}

fn solve_lower<A: RealField + Copy + Zero>(l: &Array2<A>, b: ArrayView2<'_, A>) -> Array2<A> {
    let mut x = by_columns(b);
    triangular_solve::solve_lower_triangular_in_place(view(l.view()), view_mut(&mut x), PAR);
    x
}

fn solve_lower_transposed<A: RealField + Copy + Zero>(
    l: &Array2<A>,
    b: ArrayView2<'_, A>,
) -> Array2<A> {
    let mut x = by_columns(b);
    let upper = view(l.view()).transpose();
    triangular_solve::solve_upper_triangular_in_place(upper, view_mut(&mut x), PAR);
    x
}

/// The inverse of a triangle, with nothing above its diagonal.
fn inverse_of_lower<A: RealField + Copy + Zero>(l: &Array2<A>) -> Array2<A> {
    let mut inverse = Array2::zeros(l.dim().f());
    invert_lower_triangular(view_mut(&mut inverse), view(l.view()), PAR);
    inverse
}

fn inverse_of_positive<A: RealField + Copy + Zero>(l: &Array2<A>) -> Array2<A> {
    let half = inverse_of_lower(l);
    let mut inverse = Array2::zeros(l.dim().f());
    triangular::matmul(
        view_mut(&mut inverse),
        BlockStructure::TriangularLower,
        Accum::Replace,
        view(half.t()),
        BlockStructure::TriangularUpper,
        view(half.view()),
        BlockStructure::TriangularLower,
        one(),
        PAR,
    );
    inverse
}

fn solve_positive<A: RealField + Copy + Zero + std::ops::Mul<Output = A>>(
    a: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<CholeskySolve<A>, Failure> {
    let factor = cholesky(by_columns(a))?;
    let x = solve_lower_transposed(&factor, solve_lower(&factor, b).view());
    // With A = L L^T the trace of the inverse is the sum of squares of L^-1.
    let inverse = inverse_of_lower(&factor);
    let inverse_trace = inverse.iter().fold(A::zero(), |sum, &v| sum + v * v);
    Ok(CholeskySolve { x, inverse_trace })
}

/// Passes a result on with the upper halves of vector registers clear.
///
/// faer's products can return with them in use, and then every instruction that knows only the
/// lower halves waits for them: cube roots and logarithms of 20 times the usual time were seen, until
/// something else cleared them. Vector code that rustc compiles does so when it ends.
fn clean<T>(result: T) -> T {
    struct AnyVectorCode<'a>(&'a mut [f64]);
    impl WithSimd for AnyVectorCode<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            for register in f64::registers_mut::<S>(self.0).0 {
                let lanes = Lanes::<S, f64>::new(simd, *register);
                *register = (lanes + lanes).register();
            }
        }
    }
    let mut values = std::hint::black_box([0.0; 8]);
    Level::best().run(AnyVectorCode(&mut values));
    std::hint::black_box(values);
    result
}

macro_rules! kernel {
    ($($scalar:ty),*) => {$(
        impl Backend for $scalar {
            fn product(a: ArrayView2<'_, Self>, b: ArrayView2<'_, Self>) -> Array2<Self> {
                clean(product(a, b))
            }

            fn svd(a: ArrayView2<'_, Self>) -> Result<Svd<Self>, Failure> {
                clean(decompose(a))
            }

            fn eigen(a: ArrayView2<'_, Self>) -> Result<Eigen<Self>, Failure> {
                clean(eigen(a))
            }

            fn singular_values(a: ArrayView2<'_, Self>) -> Result<Array1<Self>, Failure> {
                clean(singular_values(a))
            }

            fn triangularize(
                a: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<QrFactor<Self>, Failure> {
                Ok(clean(triangularize(a, b)))
            }

            fn triangle(a: Array2<Self>) -> Result<Array2<Self>, Failure> {
                Ok(clean(upper(&factorized(into_columns(a)).0)))
            }

            fn solve_upper(
                r: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                clean(solve_upper(r, b))
            }

            fn solve_square(
                a: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                clean(solve_square(a, b))
            }

            fn add_gram(
                a: ArrayView2<'_, Self>,
                sum: &mut Array2<Self>,
                scratch: &mut Vec<Self>,
            ) {
                clean(add_gram(a, sum, scratch));
            }

            fn solve_positive(
                a: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<CholeskySolve<Self>, Failure> {
                clean(solve_positive(a, b))
            }

            fn cholesky(a: Array2<Self>) -> Result<Array2<Self>, Failure> {
                clean(cholesky(a))
            }

            fn solve_lower(
                l: &Array2<Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                Ok(clean(solve_lower(l, b)))
            }

            fn solve_lower_transposed(
                l: &Array2<Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                Ok(clean(solve_lower_transposed(l, b)))
            }

            fn inverse_of_positive(l: &Array2<Self>) -> Result<Array2<Self>, Failure> {
                Ok(clean(inverse_of_positive(l)))
            }
        }
    )*};
}

kernel!(f32, f64);
