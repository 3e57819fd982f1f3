//! LAPACK, by way of ndarray-linalg, over the system's OpenBLAS.

use std::ffi::c_int;
use std::sync::Once;

use ndarray::linalg::general_mat_mul;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use ndarray_linalg::error::LinalgError;
use ndarray_linalg::{
    CholeskyInto, Diag, Eigh, FactorizeInto, JobSvd, Lapack, QRInto, SVDDCInto, Solve,
    SolveTriangular, UPLO,
};
use num_traits::Zero;

use super::{Backend, CholeskySolve, Eigen, Failure, QrFactor, Svd};

#[allow(unsafe_code)]
unsafe extern "C" {
    // Of OpenBLAS itself, in every version of it; void and free of preconditions.
    safe fn openblas_set_num_threads(threads: c_int);
}

/// Keeps OpenBLAS to one thread, in the whole process.
///
/// Not a matter of speed alone: its parallel LU and triangular solves put more than 1 MB on the
/// stack of the calling thread, which is the end of a Rust thread with the usual 2 MB.
fn sequential() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| openblas_set_num_threads(1));
}

/// A copy laid out by rows. ndarray-linalg refuses the strides that a row or column of a larger
/// matrix keeps.
fn by_rows<A: Copy + Zero>(a: ArrayView2<'_, A>) -> Array2<A> {
    let mut out = Array2::zeros(a.dim());
    out.assign(&a);
    out
}

fn no_convergence(_: LinalgError) -> Failure {
    Failure::NoConvergence
}

fn pivot(_: LinalgError) -> Failure {
    Failure::Pivot
}

fn decompose<A: Lapack<Real = A>>(a: ArrayView2<'_, A>) -> Result<Svd<A>, Failure> {
    match by_rows(a)
        .svddc_into(JobSvd::Some)
        .map_err(no_convergence)?
    {
        (Some(u), s, Some(vt)) => Ok(Svd { u, s, vt }),
        _ => Err(Failure::NoConvergence),
    }
}

fn eigen<A: Lapack<Real = A> + PartialOrd>(a: ArrayView2<'_, A>) -> Result<Eigen<A>, Failure> {
    // Both halves, as which of them is read depends on the layout.
    let whole = Array2::from_shape_fn(a.dim(), |(i, j)| a[[i.max(j), i.min(j)]]);
    let (values, vectors) = whole.eigh(UPLO::Lower).map_err(no_convergence)?;
    let rising = values.len();
    Ok(Eigen {
        values: Array1::from_shape_fn(rising, |i| {
            let value = values[rising - 1 - i];
            if value > A::zero() { value } else { A::zero() }
        }),
        vt: Array2::from_shape_fn((rising, rising), |(i, j)| vectors[[j, rising - 1 - i]]),
    })
}

fn triangularize<A: Lapack<Real = A>>(
    a: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<QrFactor<A>, Failure> {
    let (q, r) = by_rows(a).qr_into().map_err(no_convergence)?;
    let qtb = q.t().dot(&b);
    let rest = &b - &q.dot(&qtb);
    let residual_ss = rest.map_axis(Axis(0), |column| column.iter().map(|v| v.square()).sum());
    Ok(QrFactor {
        r,
        qtb,
        residual_ss,
    })
}

fn solve_upper<A: Lapack<Real = A>>(
    r: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<Array2<A>, Failure> {
    by_rows(r)
        .solve_triangular(UPLO::Upper, Diag::NonUnit, &by_rows(b))
        .map_err(pivot)
}

fn solve_square<A: Lapack<Real = A>>(
    a: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<Array2<A>, Failure> {
    let factor = by_rows(a).factorize_into().map_err(pivot)?;
    let mut x = Array2::zeros(b.dim());
    for (mut solution, right) in x.columns_mut().into_iter().zip(b.columns()) {
        solution.assign(&factor.solve_into(right.to_owned()).map_err(pivot)?);
    }
    Ok(x)
}

fn cholesky<A: Lapack<Real = A>>(a: ArrayView2<'_, A>) -> Result<Array2<A>, Failure> {
    by_rows(a).cholesky_into(UPLO::Lower).map_err(pivot)
}

fn solve_lower<A: Lapack<Real = A>>(
    l: &Array2<A>,
    b: ArrayView2<'_, A>,
) -> Result<Array2<A>, Failure> {
    l.solve_triangular(UPLO::Lower, Diag::NonUnit, &by_rows(b))
        .map_err(pivot)
}

fn solve_lower_transposed<A: Lapack<Real = A>>(
    l: &Array2<A>,
    b: ArrayView2<'_, A>,
) -> Result<Array2<A>, Failure> {
    solve_upper(l.t(), b)
}

fn inverse_of_positive<A: Lapack<Real = A>>(l: &Array2<A>) -> Result<Array2<A>, Failure> {
    let half = solve_lower(l, Array2::eye(l.nrows()).view())?;
    Ok(half.t().dot(&half))
}

fn solve_positive<A: Lapack<Real = A>>(
    a: ArrayView2<'_, A>,
    b: ArrayView2<'_, A>,
) -> Result<CholeskySolve<A>, Failure> {
    let lower = cholesky(a)?;
    // With A = L L^T the trace of the inverse is the sum of squares of L^-1.
    let inverse = solve_lower(&lower, Array2::eye(a.nrows()).view())?;
    Ok(CholeskySolve {
        x: solve_lower_transposed(&lower, solve_lower(&lower, b)?.view())?,
        inverse_trace: inverse.iter().map(|v| v.square()).sum(),
    })
}

macro_rules! kernel {
    ($($scalar:ty),*) => {$(
        impl Backend for $scalar {
            fn product(a: ArrayView2<'_, Self>, b: ArrayView2<'_, Self>) -> Array2<Self> {
                sequential();
                a.dot(&b)
            }

            fn svd(a: ArrayView2<'_, Self>) -> Result<Svd<Self>, Failure> {
                sequential();
                decompose(a)
            }

            fn eigen(a: ArrayView2<'_, Self>) -> Result<Eigen<Self>, Failure> {
                sequential();
                eigen(a)
            }

            fn singular_values(a: ArrayView2<'_, Self>) -> Result<Array1<Self>, Failure> {
                sequential();
                Ok(by_rows(a).svddc_into(JobSvd::None).map_err(no_convergence)?.1)
            }

            fn triangularize(
                a: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<QrFactor<Self>, Failure> {
                sequential();
                triangularize(a, b)
            }

            fn triangle(a: Array2<Self>) -> Result<Array2<Self>, Failure> {
                sequential();
                Ok(by_rows(a.view()).qr_into().map_err(no_convergence)?.1)
            }

            fn solve_upper(
                r: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                sequential();
                solve_upper(r, b)
            }

            fn solve_square(
                a: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                sequential();
                solve_square(a, b)
            }

            fn add_gram(a: ArrayView2<'_, Self>, sum: &mut Array2<Self>, _: &mut Vec<Self>) {
                sequential();
                general_mat_mul(1.0, &a.t(), &a, 1.0, sum);
            }

            fn solve_positive(
                a: ArrayView2<'_, Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<CholeskySolve<Self>, Failure> {
                sequential();
                solve_positive(a, b)
            }

            fn cholesky(a: Array2<Self>) -> Result<Array2<Self>, Failure> {
                sequential();
                cholesky(a.view())
            }

            fn solve_lower(
                l: &Array2<Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                sequential();
                solve_lower(l, b)
            }

            fn solve_lower_transposed(
                l: &Array2<Self>,
                b: ArrayView2<'_, Self>,
            ) -> Result<Array2<Self>, Failure> {
                sequential();
                solve_lower_transposed(l, b)
            }

            fn inverse_of_positive(l: &Array2<Self>) -> Result<Array2<Self>, Failure> {
                sequential();
                inverse_of_positive(l)
            }
        }
    )*};
}

kernel!(f32, f64);
