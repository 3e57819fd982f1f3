//! Measures of error between predictions and the truth.
//!
//! Of vectors each measure is a number; of matrices, shape (rows, outputs), it is a vector with a number
//! for each output.
//!
//! ```
//! use elm::metrics::{correlation, mae, r2, rmse};
//! use ndarray::array;
//!
//! let (predicted, truth) = (array![1.0, 2.0, 5.0], array![1.0, 3.0, 4.0]);
//! assert_eq!(rmse(&predicted, &truth)?, (2.0_f64 / 3.0).sqrt());
//! assert_eq!(mae(&predicted, &truth)?, 2.0 / 3.0);
//! assert!((r2(&predicted, &truth)? - 4.0 / 7.0).abs() < 1e-15);
//! assert_eq!(correlation(&predicted, &[7.0, 7.0, 7.0])?, None);
//!
//! let (predicted, truth) = (array![[1.0, 0.0], [2.0, 0.5]], array![[1.0, 1.0], [2.0, 1.5]]);
//! assert_eq!(rmse(&predicted, &truth)?, array![0.0, 1.0]);
//! # Ok::<(), elm::Error>(())
//! ```
//!
//! Of classes: [`accuracy`], [`balanced_accuracy`] and [`confusion_matrix`] of predicted labels;
//! [`log_loss`], [`brier_score`], [`roc_auc`] and [`calibration_error`] of probabilities.

mod classes;

use ndarray::{Array1, ArrayView1, ArrayView2, Axis};

use crate::check::check_length;
use crate::dataset::{TargetDim, Targets, matrix};
use crate::error::{Error, Result};
use crate::scalar::{Scalar, power_of_two};
use crate::stats::{Sum, sum};
pub use classes::{
    accuracy, balanced_accuracy, brier_score, calibration_error, confusion_matrix, log_loss,
    roc_auc,
};

/// Root mean squared error.
///
/// # Errors
/// [`Error::Shape`] when rows or outputs differ, [`Error::Empty`] when there is nothing to compare,
/// [`Error::NotFinite`] for a NaN or infinity.
#[doc(alias = "root_mean_squared_error")]
pub fn rmse<A, P, T>(predicted: &P, truth: &T) -> Result<<T::Dim as TargetDim>::PerOutput<f64>>
where
    A: Scalar,
    P: Targets<A, Dim = T::Dim> + ?Sized,
    T: Targets<A> + ?Sized,
{
    each(predicted, truth, |columns| {
        let squares = sum(columns.pairs().map(|(p, t)| (p - t) * (p - t)));
        if in_range(squares) {
            return Ok((squares / columns.truth.len() as f64).sqrt());
        }
        columns.check_finite()?;
        let errors = columns.pairs().map(|(p, t)| (p - t, 1.0));
        Ok(scaled_root_mean_square(errors))
    })
}

/// Mean absolute error.
///
/// # Errors
/// Those of [`rmse`].
#[doc(alias = "mean_absolute_error")]
pub fn mae<A, P, T>(predicted: &P, truth: &T) -> Result<<T::Dim as TargetDim>::PerOutput<f64>>
where
    A: Scalar,
    P: Targets<A, Dim = T::Dim> + ?Sized,
    T: Targets<A> + ?Sized,
{
    each(predicted, truth, |columns| {
        let n = columns.truth.len() as f64;
        let errors = || columns.pairs().map(|(p, t)| (p - t).abs());
        let whole = sum(errors());
        if whole.is_finite() {
            return Ok(whole / n);
        }
        columns.check_finite()?;
        // Divided before it is summed: the sum of many errors of 1e308 is out of range.
        Ok(sum(errors().map(|error| error / n)))
    })
}

/// The coefficient of determination $R^2 = 1 - \sum (p - t)^2 / \sum (t - \bar t)^2$: 1 for a perfect
/// prediction, 0 for one that is no better than the mean of the truth, negative for a worse one. Where the
/// truth is constant and the quotient does not exist, 1 if the prediction is exact and else 0.
///
/// # Errors
/// Those of [`rmse`].
#[doc(alias = "r2_score")]
#[doc(alias = "coefficient_of_determination")]
pub fn r2<A, P, T>(predicted: &P, truth: &T) -> Result<<T::Dim as TargetDim>::PerOutput<f64>>
where
    A: Scalar,
    P: Targets<A, Dim = T::Dim> + ?Sized,
    T: Targets<A> + ?Sized,
{
    each(predicted, truth, |columns| {
        columns.check_finite()?;
        // As squares of 1e200 are out of range; a power of two rounds nothing.
        let factor = power_of_two(columns.largest()).recip();
        let scaled = || columns.pairs().map(|(p, t)| (p * factor, t * factor));
        let squares = sum(scaled().map(|(p, t)| (p - t) * (p - t)));
        let total = CenteredSums::of(scaled()).tt;
        if total > 0.0 && !is_constant(columns.truth) {
            Ok(1.0 - squares / total)
        } else if squares == 0.0 {
            Ok(1.0)
        } else {
            Ok(0.0)
        }
    })
}

/// Pearson's correlation coefficient; `None` where it does not exist, that is, where the values of
/// one of the two are all equal.
///
/// # Errors
/// Those of [`rmse`].
#[doc(alias = "pearsonr")]
pub fn correlation<A, P, T>(
    predicted: &P,
    truth: &T,
) -> Result<<T::Dim as TargetDim>::PerOutput<Option<f64>>>
where
    A: Scalar,
    P: Targets<A, Dim = T::Dim> + ?Sized,
    T: Targets<A> + ?Sized,
{
    each(predicted, truth, |columns| {
        let mut sums = CenteredSums::of(columns.pairs());
        if !(in_range(sums.pp) && in_range(sums.tt)) {
            columns.check_finite()?;
            let factor_p = power_of_two(largest(columns.predicted)).recip();
            let factor_t = power_of_two(largest(columns.truth)).recip();
            let scaled = columns.pairs().map(|(p, t)| (p * factor_p, t * factor_t));
            sums = CenteredSums::of(scaled);
        }
        let varies = sums.pp > 0.0 && sums.tt > 0.0;
        if !varies || is_constant(columns.predicted) || is_constant(columns.truth) {
            return Ok(None);
        }
        let r = sums.pt / (sums.pp.sqrt() * sums.tt.sqrt());
        Ok(Some(r.clamp(-1.0, 1.0)))
    })
}

/// Predictions of one output and the truth.
struct Columns<'a, A: Scalar> {
    predicted: ArrayView1<'a, A>,
    truth: ArrayView1<'a, A>,
    output: usize,
}

impl<A: Scalar> Columns<'_, A> {
    fn pairs(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        let both = self.predicted.iter().zip(self.truth);
        both.map(|(p, t)| (p.as_f64(), t.as_f64()))
    }

    /// The largest magnitude of either.
    fn largest(&self) -> f64 {
        largest(self.predicted).max(largest(self.truth))
    }

    fn check_finite(&self) -> Result<()> {
        for (what, values) in [("predictions", self.predicted), ("truth", self.truth)] {
            if let Some(row) = values.iter().position(|value| !value.is_finite()) {
                let column = self.output;
                return Err(Error::NotFinite { what, row, column });
            }
        }
        Ok(())
    }
}

/// A measure of each output.
fn each<A, P, T, R>(
    predicted: &P,
    truth: &T,
    measure: impl Fn(&Columns<'_, A>) -> Result<R>,
) -> Result<<T::Dim as TargetDim>::PerOutput<R>>
where
    A: Scalar,
    P: Targets<A, Dim = T::Dim> + ?Sized,
    T: Targets<A> + ?Sized,
{
    let (predicted, truth) = (matrix(predicted.as_array()), matrix(truth.as_array()));
    check_length("predictions", predicted.nrows(), truth.nrows())?;
    check_length("outputs of predictions", predicted.ncols(), truth.ncols())?;
    if truth.is_empty() {
        return Err(Error::Empty {
            what: "truth",
            rows: truth.nrows(),
            columns: truth.ncols(),
        });
    }
    <T::Dim>::per_output(truth.ncols(), |output| {
        measure(&Columns {
            predicted: predicted.column(output),
            truth: truth.column(output),
            output,
        })
    })
}

/// The largest magnitude.
fn largest<A: Scalar>(values: ArrayView1<'_, A>) -> f64 {
    values.iter().fold(0.0, |m: f64, v| m.max(v.as_f64().abs()))
}

/// Whether all values are equal: their mean may round, so that their sum of squares about it need not
/// be 0.
fn is_constant<A: Scalar>(values: ArrayView1<'_, A>) -> bool {
    values.iter().all(|value| *value == values[0])
}

/// Of two columns the sums of squares and products about their means.
struct CenteredSums {
    pp: f64,
    tt: f64,
    pt: f64,
}

impl CenteredSums {
    fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let (mut n, mut sum_p, mut sum_t) = (0.0, Sum::default(), Sum::default());
        for (p, t) in pairs.clone() {
            n += 1.0;
            sum_p.add(p);
            sum_t.add(t);
        }
        let (mean_p, mean_t) = (sum_p.value() / n, sum_t.value() / n);
        let (mut rest_p, mut rest_t) = (Sum::default(), Sum::default());
        let (mut pp, mut tt, mut pt) = (Sum::default(), Sum::default(), Sum::default());
        for (p, t) in pairs {
            let (p, t) = (p - mean_p, t - mean_t);
            rest_p.add(p);
            rest_t.add(t);
            pp.add(p * p);
            tt.add(t * t);
            pt.add(p * t);
        }
        // What the means have missed, and what that has added.
        let (rest_p, rest_t) = (rest_p.value(), rest_t.value());
        pp.add(-rest_p * rest_p / n);
        tt.add(-rest_t * rest_t / n);
        pt.add(-rest_p * rest_t / n);
        Self {
            pp: pp.value(),
            tt: tt.value(),
            pt: pt.value(),
        }
    }
}

/// Whether a sum of squares has neither overflowed nor lost what is too small to be squared; of
/// nothing but zeros, or of a NaN, that is not known.
fn in_range(squares: f64) -> bool {
    (1e-200..f64::INFINITY).contains(&squares)
}

/// Root of the weighted mean of squares; 0 of nothing.
pub(crate) fn root_mean_square<A: Scalar>(
    values: ArrayView1<'_, A>,
    weights: ArrayView1<'_, A>,
) -> f64 {
    let pairs = values.iter().zip(weights);
    scaled_root_mean_square(pairs.map(|(v, w)| (v.as_f64(), w.as_f64())))
}

/// Root of the mean of squares of each column.
pub(crate) fn root_mean_squares<A: Scalar>(values: ArrayView2<'_, A>) -> Array1<f64> {
    values.map_axis(Axis(0), |column| {
        scaled_root_mean_square(column.iter().map(|value| (value.as_f64(), 1.0)))
    })
}

/// Of values and weights. Scaled by a power of two, as squares of 1e200 are out of range.
fn scaled_root_mean_square(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let largest = pairs.clone().fold(0.0, |m: f64, (value, _)| {
        // Unlike f64::max this keeps a NaN.
        if m >= value.abs() || m.is_nan() {
            m
        } else {
            value.abs()
        }
    });
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    let unit = power_of_two(largest);
    let factor = unit.recip();
    let (mut squares, mut total) = (Sum::default(), Sum::default());
    for (value, weight) in pairs {
        squares.add(weight * (value * factor).powi(2));
        total.add(weight);
    }
    unit * (squares.value() / total.value()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array1, array};

    #[test]
    fn errors_of_a_hand_computed_case() {
        let (p, t) = (array![1.0, 2.0, 3.0, 4.0], array![1.0, 0.0, 3.0, 8.0]);
        assert_eq!(rmse(&p, &t).unwrap(), 5.0_f64.sqrt());
        assert_eq!(mae(&p, &t).unwrap(), 1.5);
        // Deviations (-1.5, -0.5, 0.5, 1.5) and (-2, -3, 0, 5): 12 / sqrt(5 * 38).
        let r = correlation(&p, &t).unwrap().unwrap();
        approx::assert_relative_eq!(r, 12.0 / 190.0_f64.sqrt(), max_relative = 1e-15);
    }

    #[test]
    fn squares_out_of_range_do_no_harm_and_nan_is_named() {
        let zero = Array1::zeros(4);
        for size in [1e-200, 1e200] {
            let p = array![3.0, -4.0, 0.0, 0.0] * size;
            approx::assert_relative_eq!(rmse(&p, &zero).unwrap(), 2.5 * size, max_relative = 1e-15);
        }
        for place in 0..4 {
            let mut p = array![1.0, 2.0, 3.0, 4.0];
            p[place] = f64::NAN;
            let expected = Error::NotFinite {
                what: "predictions",
                row: place,
                column: 0,
            };
            assert_eq!(rmse(&p, &zero), Err(expected.clone()));
            assert_eq!(mae(&p, &zero), Err(expected.clone()));
            assert_eq!(correlation(&p, &zero), Err(expected));
        }
    }

    #[test]
    fn scale_does_not_change_a_correlation() {
        let (p, t) = (array![1.0, 2.0, 3.0, 4.0], array![1.0, 0.0, 3.0, 8.0]);
        let r = correlation(&p, &t).unwrap().unwrap();
        for (a, b) in [
            (1e-200, 1e-200),
            (1e200, 1e-200),
            (1e307, 1e300),
            (1e-310, 1.0),
        ] {
            let found = correlation(&(&p * a), &(&t * b)).unwrap().unwrap();
            approx::assert_relative_eq!(found, r, max_relative = 1e-12);
        }
    }

    #[test]
    fn a_constant_has_no_correlation() {
        let (constant, t) = (Array1::from_elem(7, 0.1), Array1::linspace(0.0, 1.0, 7));
        assert_eq!(correlation(&constant, &t).unwrap(), None);
        assert_eq!(correlation(&t, &constant).unwrap(), None);
    }

    #[test]
    fn a_million_rows_cost_neither_a_constant_nor_a_small_variation() {
        let rows = 1_000_000;
        let t = Array1::from_shape_fn(rows, |row| f64::from((row % 7) as u8));
        let constant = Array1::from_elem(rows, 273.15);
        assert_eq!(correlation(&constant, &t).unwrap(), None);
        // Exact multiples of 2^-30 beside a mean of 1e6.
        let small = t.mapv(|t| 1e6 + t * 0.5_f64.powi(30));
        let r = correlation(&small, &t).unwrap().unwrap();
        approx::assert_relative_eq!(r, 1.0, max_relative = 1e-14);
        let wrong = &constant + 0.1;
        let error = (273.15 + 0.1) - 273.15;
        for found in [mae(&wrong, &constant), rmse(&wrong, &constant)] {
            approx::assert_relative_eq!(found.unwrap(), error, max_relative = 2.0 * f64::EPSILON);
        }
    }

    #[test]
    fn lengths_must_agree_and_not_be_zero() {
        let (short, long, none) = (array![1.0], array![1.0, 2.0], Array1::<f64>::zeros(0));
        assert!(matches!(
            rmse(&short, &long),
            Err(Error::Shape {
                expected: 2,
                found: 1,
                ..
            })
        ));
        assert!(matches!(mae(&none, &none), Err(Error::Empty { .. })));
    }

    #[test]
    fn matrices_are_measured_output_by_output() {
        let (p, t) = (
            array![[1.0, 5.0], [2.0, 7.0], [4.0, 8.0]],
            array![[1.0, 5.5], [3.0, 7.5], [4.0, 7.0]],
        );
        for output in 0..2 {
            let (p_one, t_one) = (p.column(output), t.column(output));
            assert_eq!(rmse(&p, &t).unwrap()[output], rmse(&p_one, &t_one).unwrap());
            assert_eq!(mae(&p, &t).unwrap()[output], mae(&p_one, &t_one).unwrap());
            assert_eq!(r2(&p, &t).unwrap()[output], r2(&p_one, &t_one).unwrap());
            let both = correlation(&p, &t).unwrap();
            assert_eq!(both[output], correlation(&p_one, &t_one).unwrap());
        }
        assert!(matches!(
            rmse(&p, &t.slice(ndarray::s![.., ..1])),
            Err(Error::Shape {
                what: "outputs of predictions",
                ..
            })
        ));
        let mut bad = t.clone();
        bad[[2, 1]] = f64::NAN;
        let expected = Error::NotFinite {
            what: "truth",
            row: 2,
            column: 1,
        };
        assert_eq!(r2(&p, &bad), Err(expected));
    }

    #[test]
    fn the_coefficient_of_determination_is_that_of_its_definition_at_any_size() {
        let (p, t) = (array![2.5, 0.0, 2.0, 8.0], array![3.0, -0.5, 2.0, 7.0]);
        // 1.5 over 29.1875.
        for size in [1.0, 1e-200, 1e200] {
            let found = r2(&(&p * size), &(&t * size)).unwrap();
            approx::assert_relative_eq!(found, 1.0 - 1.5 / 29.1875, max_relative = 1e-14);
        }
        assert_eq!(r2(&t, &t).unwrap(), 1.0);
        let constant = Array1::from_elem(4, 0.1);
        assert_eq!(r2(&constant, &constant).unwrap(), 1.0);
        assert_eq!(r2(&p, &constant).unwrap(), 0.0);
    }
}
