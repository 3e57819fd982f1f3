//! Singular values and eigenvalues.

use faer::Conj;
use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::householder::{
    apply_block_householder_sequence_on_the_left_in_place_with_conj as apply_q,
    apply_block_householder_sequence_transpose_on_the_left_in_place_scratch as sequence_scratch,
};
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::traits::RealField;
use ndarray::{Array1, Array2, ArrayView2, Axis, ShapeBuilder, s};
use num_traits::Zero;

use super::{PAR, factorized, gapless, in_slabs, upper, view, view_mut};
use crate::linalg::{Eigen, Failure, Svd};

pub(super) fn eigen<A: RealField + Copy + Zero + PartialOrd>(
    a: ArrayView2<'_, A>,
) -> Result<Eigen<A>, Failure> {
    let n = a.nrows();
    let a = gapless(a);
    let mut values = Array1::zeros(n);
    let mut vectors = Array2::zeros((n, n).f());
    let yes = ComputeEigenvectors::Yes;
    let scratch = self_adjoint_evd_scratch::<A>(n, yes, PAR, Default::default());
    self_adjoint_evd(
        view(a.view()),
        DiagMut::from_slice_mut(values.as_slice_memory_order_mut().unwrap_or(&mut [])),
        Some(view_mut(&mut vectors)),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| Failure::NoConvergence)?;
    // They rise.
    values.invert_axis(Axis(0));
    vectors.invert_axis(Axis(1));
    let positive = |value: A| if value > A::zero() { value } else { A::zero() };
    Ok(Eigen {
        values: values.mapv_into(positive),
        vt: vectors.reversed_axes().as_standard_layout().into_owned(),
    })
}

pub(super) fn decompose<A: RealField + Copy + Zero>(
    a: ArrayView2<'_, A>,
) -> Result<Svd<A>, Failure> {
    /// Multiplications above which threads pay for factorizing a triangle by itself.
    const LARGE: usize = 1 << 26;
    let (rows, columns) = a.dim();
    if rows >= 2 * columns && rows.saturating_mul(columns * columns) >= LARGE {
        return decompose_by_triangle(a);
    }
    let k = rows.min(columns);
    let a = gapless(a);
    let mut s = Array1::zeros(k);
    let mut u = Array2::zeros((rows, k).f());
    let mut v = Array2::zeros((columns, k).f());
    let thin = ComputeSvdVectors::Thin;
    let scratch = svd_scratch::<A>(rows, columns, thin, thin, PAR, Default::default());
    svd(
        view(a.view()),
        DiagMut::from_slice_mut(s.as_slice_memory_order_mut().unwrap_or(&mut [])),
        Some(view_mut(&mut u)),
        Some(view_mut(&mut v)),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| Failure::NoConvergence)?;
    Ok(Svd {
        u,
        s,
        vt: v.reversed_axes(),
    })
}

/// Of a matrix of many rows: of its triangle, whose left singular vectors are then rotated back.
fn decompose_by_triangle<A: RealField + Copy + Zero>(
    a: ArrayView2<'_, A>,
) -> Result<Svd<A>, Failure> {
    let (rows, columns) = a.dim();
    let (basis, factor) = factorized(a);
    let Svd { u: inner, s, vt } = decompose(upper(&basis).view())?;
    let mut u = Array2::zeros((rows, columns).f());
    u.slice_mut(s![..columns, ..]).assign(&inner);
    in_slabs(view_mut(&mut u), 2 * rows * columns, |slab| {
        let scratch = sequence_scratch::<A>(rows, factor.nrows(), slab.ncols());
        let (basis, factor) = (view(basis.view()), view(factor.view()));
        let mut memory = MemBuffer::new(scratch);
        let stack = MemStack::new(&mut memory);
        apply_q(basis, factor, Conj::No, slab, PAR, stack);
    });
    Ok(Svd { u, s, vt })
}

pub(super) fn singular_values<A: RealField + Copy + Zero>(
    a: ArrayView2<'_, A>,
) -> Result<Array1<A>, Failure> {
    let (rows, columns) = a.dim();
    let a = gapless(a);
    let mut s = Array1::zeros(rows.min(columns));
    let none = ComputeSvdVectors::No;
    let scratch = svd_scratch::<A>(rows, columns, none, none, PAR, Default::default());
    svd(
        view(a.view()),
        DiagMut::from_slice_mut(s.as_slice_memory_order_mut().unwrap_or(&mut [])),
        None,
        None,
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| Failure::NoConvergence)?;
    Ok(s)
}
