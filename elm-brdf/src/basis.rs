//! A few coordinates that stand for the targets of many channels.
//!
//! Values at neighbouring wavelengths go together: a spectrum of a surface changes with direction in few
//! ways, such as the share of the highlight and its colour at grazing angles. The targets of all channels are
//! therefore their mean plus a combination of few directions, the principal axes of the measured targets
//! (I. Jolliffe, *Principal Component Analysis*, 2nd edition, 2002), and a network has an output for each
//! of these: reduced-rank regression, whose output weights are of low rank.

use faer::{MatRef, Side};
use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Rows that the axes are found from, at most.
const ROWS: usize = 4000;

/// The mean of the targets of all channels, and the directions from it that they vary along.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Basis {
    mean: Array1<f64>,
    /// Orthonormal rows, the one of the largest variance first, shape (outputs, channels).
    axes: Array2<f64>,
}

impl Basis {
    /// The first principal axes of `targets`, shape (rows, channels); no more than there are channels.
    ///
    /// # Errors
    /// [`Error::NoConvergence`] for targets that are not finite.
    pub(crate) fn fit(targets: ArrayView2<'_, f64>, outputs: usize) -> Result<Self> {
        let step = targets.nrows().div_ceil(ROWS).max(1);
        let some = targets.slice_axis(Axis(0), Slice::new(0, None, step as isize));
        let channels = some.ncols();
        let mean = some
            .mean_axis(Axis(0))
            .unwrap_or_else(|| Array1::zeros(channels));
        let centred = &some - &mean;
        let products = centred.t().dot(&centred).as_standard_layout().into_owned();
        let no_axes = || Error::NoConvergence {
            what: "the search for the principal axes of a spectrum",
        };
        let slice = products.as_slice().ok_or_else(no_axes)?;
        let eigen = MatRef::from_row_major_slice(slice, channels, channels)
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| no_axes())?;
        let vectors = eigen.U();
        // Eigenvalues rise; the sign of a vector is any, so let its largest part be positive.
        let mut axes = Array2::from_shape_fn((outputs.min(channels), channels), |(row, column)| {
            vectors[(column, channels - 1 - row)]
        });
        // Divide and conquer does not always say that it failed.
        if !axes.iter().all(|value| value.is_finite()) {
            return Err(no_axes());
        }
        for mut axis in axes.rows_mut() {
            let largest = axis
                .iter()
                .copied()
                .fold(0.0_f64, |a, b| if b.abs() > a.abs() { b } else { a });
            if largest < 0.0 {
                axis *= -1.0;
            }
        }
        Ok(Self { mean, axes })
    }

    /// The same with the first axes alone.
    pub(crate) fn first(&self, outputs: usize) -> Self {
        let range = Slice::from(..outputs.min(self.outputs()));
        Self {
            mean: self.mean.clone(),
            axes: self.axes.slice_axis(Axis(0), range).to_owned(),
        }
    }

    /// Number of coordinates.
    pub(crate) fn outputs(&self) -> usize {
        self.axes.nrows()
    }

    /// Number of channels.
    pub(crate) fn channels(&self) -> usize {
        self.mean.len()
    }

    /// The mean target of each channel.
    pub(crate) fn mean(&self) -> &Array1<f64> {
        &self.mean
    }

    /// The axes, shape (outputs, channels).
    pub(crate) fn axes(&self) -> &Array2<f64> {
        &self.axes
    }

    /// Coordinates of targets, shape (rows, outputs).
    pub(crate) fn project(&self, targets: &Array2<f64>) -> Array2<f64> {
        (targets - &self.mean).dot(&self.axes.t())
    }

    /// Targets at coordinates, shape (rows, channels).
    pub(crate) fn expand(&self, coordinates: &Array2<f64>) -> Array2<f64> {
        coordinates.dot(&self.axes) + &self.mean
    }

    /// Whether one from outside makes sense.
    ///
    /// # Errors
    /// [`Error::Shape`] and [`Error::NotFinite`].
    pub(crate) fn check(&self) -> Result<()> {
        if self.axes.ncols() != self.mean.len() {
            return Err(Error::Shape {
                what: "channels of the basis",
                expected: self.mean.len(),
                found: self.axes.ncols(),
            });
        }
        let wrong = |(_, value): &(_, &f64)| !value.is_finite();
        match self.axes.indexed_iter().find(wrong) {
            Some(((row, column), _)) => Err(Error::NotFinite {
                what: "axes of the basis",
                row,
                column,
            }),
            None if self.mean.iter().any(|mean| !mean.is_finite()) => Err(Error::NotFinite {
                what: "mean of the basis",
                row: 0,
                column: 0,
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Three patterns over eight channels, the weakest a hundredth of the strongest.
    fn targets() -> Array2<f64> {
        Array2::from_shape_fn((60, 8), |(row, channel)| {
            let (t, c) = (row as f64, channel as f64);
            5.0 + (0.3 * t).sin() * (1.0 + c)
                + 0.3 * (1.1 * t).cos() * (c - 3.0).powi(2)
                + 0.01 * (2.3 * t).sin() * (-1.0_f64).powi(channel as i32)
        })
    }

    #[test]
    fn as_many_axes_as_there_are_patterns_give_the_targets_back() {
        let targets = targets();
        let basis = Basis::fit(targets.view(), 3).unwrap();
        assert_eq!((basis.outputs(), basis.channels()), (3, 8));
        let back = basis.expand(&basis.project(&targets));
        assert_abs_diff_eq!(back, targets, epsilon = 1e-12);
        let gram = basis.axes().dot(&basis.axes().t());
        assert_abs_diff_eq!(gram, Array2::eye(3), epsilon = 1e-13);
        let lacking = basis.first(2);
        let left = lacking.expand(&lacking.project(&targets)) - &targets;
        let worst = left.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        assert!((0.005..0.02).contains(&worst), "{worst}");
    }

    #[test]
    fn a_single_row_is_its_mean() {
        let row = Array2::from_elem((1, 5), 2.5);
        let basis = Basis::fit(row.view(), 2).unwrap();
        assert_abs_diff_eq!(basis.expand(&basis.project(&row)), row, epsilon = 1e-15);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let good = Basis::fit(targets().view(), 2).unwrap();
        good.check().unwrap();
        let mut bad = good.clone();
        bad.axes[[1, 3]] = f64::NAN;
        assert!(bad.check().is_err());
        let mut bad = good.clone();
        bad.mean = Array1::zeros(7);
        assert!(bad.check().is_err());
    }
}
