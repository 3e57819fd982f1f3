//! The posterior of ridge's output weights, as far as the variance of predictions needs it: the factor of a
//! problem without its rows.

use ndarray::{Array1, Array2, ArrayRef1, ArrayRef2, ArrayView1, Zip};
#[cfg(feature = "serde")]
use ndarray::{Axis, aview2};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

#[cfg(feature = "serde")]
use crate::check::{check_finite, check_length};
#[cfg(feature = "serde")]
use crate::error::Result;
use crate::scalar::Scalar;
use crate::solve::design_svd::DesignSvd;

/// Singular values and right singular vectors of the hidden-layer matrix, weighted, centered and scaled.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", deny_unknown_fields))]
pub(crate) struct Posterior<A: Scalar> {
    /// What hidden values are divided by.
    scale: A,
    /// What is then taken off each column.
    mean: Array1<A>,
    s: Array1<A>,
    /// A singular vector in each row.
    vt: Array2<A>,
    /// What an intercept adds to each variance: $1 / n$, or 0 without one.
    constant: A,
}

impl<A: Scalar> Posterior<A> {
    pub(super) fn of(spectrum: &DesignSvd<A>, constant: A) -> Self {
        let frame = &spectrum.frame;
        Self {
            scale: frame.hidden_scale,
            mean: frame.hidden_mean.mapv(|m| m / frame.hidden_scale),
            s: spectrum.s.clone(),
            vt: spectrum.vt.clone(),
            constant,
        }
    }

    /// Whether it is of a layer of `columns` columns.
    #[cfg(feature = "serde")]
    pub(crate) fn check(&self, columns: usize) -> Result<()> {
        check_length("columns of a posterior", self.mean.len(), columns)?;
        check_length("singular vectors", self.vt.ncols(), columns)?;
        check_length("singular values", self.s.len(), self.vt.nrows())?;
        check_finite("singular vectors", self.vt.view())?;
        check_finite("singular values", self.s.view().insert_axis(Axis(0)))?;
        check_finite("means", self.mean.view().insert_axis(Axis(0)))?;
        check_finite(
            "scale and intercept",
            aview2(&[[self.scale, self.constant]]),
        )
    }

    /// $1/n + \tilde h^T (\tilde H^T \tilde H + \lambda)^{-1} \tilde h$ for each new hidden row and each
    /// output's relative strength, shape (rows, outputs).
    pub(crate) fn variance_factor(&self, hidden: &ArrayRef2<A>, lambda: &[f64]) -> Array2<A> {
        let (inside, outside) = coordinates(hidden, self.scale, &self.mean, &self.vt);
        let largest = self.s.first().copied().unwrap_or(A::zero());
        let mut spread = Array2::zeros((hidden.nrows(), lambda.len()));
        for (mut column, &lambda) in spread.columns_mut().into_iter().zip(lambda) {
            let absolute = A::from_f64(lambda) * largest * largest;
            Zip::from(&mut column)
                .and(inside.rows())
                .and(&outside)
                .for_each(|spread, row, &rest| {
                    let within: A = row
                        .iter()
                        .zip(&self.s)
                        .map(|(&p, &s)| p * p / (s * s + absolute))
                        .sum();
                    let beyond = if rest > A::zero() {
                        rest / absolute
                    } else {
                        A::zero()
                    };
                    *spread = self.constant + within + beyond;
                });
        }
        spread
    }
}

/// Coordinates of hidden rows: scaled, centered, along the right singular vectors (shape (rows, $k$)), and
/// the squared length that lies outside them.
pub(super) fn coordinates<A: Scalar>(
    hidden: &ArrayRef2<A>,
    scale: A,
    mean: &ArrayRef1<A>,
    vt: &ArrayRef2<A>,
) -> (Array2<A>, Array1<A>) {
    // Scaled before centering, as the difference of two huge values may overflow.
    let centered = hidden / scale - mean;
    let inside = A::product(centered.view(), vt.t());
    let length = |row: ArrayView1<'_, A>| row.dot(&row);
    let outside = Zip::from(centered.rows())
        .and(inside.rows())
        .map_collect(|all, inside| (length(all) - length(inside)).max(A::zero()));
    (inside, outside)
}
