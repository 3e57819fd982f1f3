//! Singular values and eigenvalues.

use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{
    ComputeEigenvectors, SelfAdjointEvdParams, self_adjoint_evd, self_adjoint_evd_scratch,
};
use faer::linalg::householder::{
    apply_block_householder_sequence_on_the_left_in_place_with_conj as apply_q,
    apply_block_householder_sequence_transpose_on_the_left_in_place_scratch as sequence_scratch,
};
use faer::linalg::svd::{ComputeSvdVectors, SvdParams, svd, svd_scratch};
use faer::traits::RealField;
use faer::traits::math_utils::is_finite;
use faer::{Auto, Conj, Spec};
use ndarray::{Array1, Array2, ArrayView2, Axis, ShapeBuilder, s};
use num_traits::Zero;

use super::{PAR, by_columns, factorized, gapless, in_slabs, upper, view, view_mut};
use crate::linalg::{Eigen, Failure, Svd};

pub(super) fn eigen<A: RealField + Copy + Zero + PartialOrd>(
    a: ArrayView2<'_, A>,
) -> Result<Eigen<A>, Failure> {
    let n = a.nrows();
    let a = gapless(a);
    let yes = ComputeEigenvectors::Yes;
    let by = |params: SelfAdjointEvdParams| {
        let mut values = Array1::zeros(n);
        let mut vectors = Array2::zeros((n, n).f());
        let params = Spec::new(params);
        let scratch = self_adjoint_evd_scratch::<A>(n, yes, PAR, params);
        self_adjoint_evd(
            view(a.view()),
            DiagMut::from_slice_mut(values.as_slice_memory_order_mut().unwrap_or(&mut [])),
            Some(view_mut(&mut vectors)),
            PAR,
            MemStack::new(&mut MemBuffer::new(scratch)),
            params,
        )
        .map_err(|_| Failure::NoConvergence)?;
        Ok((values, vectors))
    };
    let found = |(values, vectors): &(Array1<A>, Array2<A>)| are_finite(values, [vectors]);
    let mut params = <SelfAdjointEvdParams as Auto<A>>::auto();
    let divided = by(params)?;
    let (mut values, mut vectors) = if found(&divided) {
        divided
    } else {
        params.recursion_threshold = usize::MAX;
        Some(by(params)?)
            .filter(found)
            .ok_or(Failure::NoConvergence)?
    };
    // They rise.
    values.invert_axis(Axis(0));
    vectors.invert_axis(Axis(1));
    let positive = |value: A| if value > A::zero() { value } else { A::zero() };
    Ok(Eigen {
        values: values.mapv_into(positive),
        vt: vectors.reversed_axes().as_standard_layout().into_owned(),
    })
}

/// Whether all of these are numbers. Divide and conquer does not always say so: of the triangle of a hidden
/// layer of rank 1866, 1876 columns, three singular values were not, and all vectors.
fn are_finite<A: RealField, const N: usize>(values: &Array1<A>, vectors: [&Array2<A>; N]) -> bool {
    values.iter().all(is_finite) && vectors.iter().all(|vectors| vectors.iter().all(is_finite))
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
    let a = gapless(a);
    let mut params = <SvdParams as Auto<A>>::auto();
    let found = |svd: &Svd<A>| are_finite(&svd.s, [&svd.u, &svd.vt]);
    let divided = thin_svd(a.view(), params)?;
    if found(&divided) {
        return Ok(divided);
    }
    // Other rounding errors, in the same time.
    let Svd { u, s, vt } = thin_svd(a.t(), params)?;
    let transposed = Svd {
        u: vt.reversed_axes(),
        s,
        vt: u.reversed_axes(),
    };
    if found(&transposed) {
        return Ok(transposed);
    }
    // QR iteration, in three times as much.
    params.recursion_threshold = usize::MAX;
    Some(thin_svd(a.view(), params)?)
        .filter(found)
        .ok_or(Failure::NoConvergence)
}

/// As it comes, whether it is numbers or not, of a matrix without gaps.
fn thin_svd<A: RealField + Copy + Zero>(
    a: ArrayView2<'_, A>,
    params: SvdParams,
) -> Result<Svd<A>, Failure> {
    let (rows, columns) = a.dim();
    let k = rows.min(columns);
    let mut s = Array1::zeros(k);
    let mut u = Array2::zeros((rows, k).f());
    let mut v = Array2::zeros((columns, k).f());
    let (thin, params) = (ComputeSvdVectors::Thin, Spec::new(params));
    let scratch = svd_scratch::<A>(rows, columns, thin, thin, PAR, params);
    svd(
        view(a),
        DiagMut::from_slice_mut(s.as_slice_memory_order_mut().unwrap_or(&mut [])),
        Some(view_mut(&mut u)),
        Some(view_mut(&mut v)),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        params,
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
    let (basis, factor) = factorized(by_columns(a));
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

#[test]
fn the_ways_that_stand_in_for_divide_and_conquer_find_the_same() {
    // Above the size at which it divides.
    let a = Array2::from_shape_fn((200, 150), |(i, j)| (0.1 * (i * (j + 3)) as f64).sin());
    let mut iterated = <SvdParams as Auto<f64>>::auto();
    let divided = thin_svd(a.view(), iterated).unwrap();
    iterated.recursion_threshold = usize::MAX;
    for other in [
        thin_svd(a.t(), <SvdParams as Auto<f64>>::auto()).unwrap(),
        thin_svd(a.view(), iterated).unwrap(),
    ] {
        assert!(are_finite(&other.s, [&other.u, &other.vt]));
        let apart = (&other.s - &divided.s).mapv(f64::abs).sum();
        assert!(apart < 1e-11 * divided.s[0], "{apart:e}");
    }
    let mut with = divided.u.clone();
    with[[7, 3]] = f64::NAN;
    assert!(!are_finite(&divided.s, [&divided.u, &with]));
}
