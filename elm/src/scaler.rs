//! Standardisation of inputs: mean 0 and standard deviation 1 over the training rows.

use ndarray::{Array1, Array2, ArrayRef1, ArrayRef2, ArrayView1, ArrayView2, Axis, Zip};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::scalar::{Scalar, power_of_two};
use crate::solve::{check_length, check_matrix};

/// Subtracts each input's mean and divides by its standard deviation (with divisor $n$).
///
/// An input that is constant over the training rows carries no information and is mapped to 0,
/// whatever value it takes later.
///
/// ```
/// use elm::Scaler;
/// use ndarray::array;
///
/// let scaler = Scaler::measured(&array![[1.0, 0.5], [3.0, 0.5]])?;
/// assert_eq!(scaler.mean(), array![2.0, 0.5]);
/// // The second input is constant.
/// assert_eq!(scaler.factor(), array![1.0, 0.0]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "", try_from = "Parts<A>")]
pub struct Scaler<A: Scalar> {
    mean: Array1<A>,
    /// 1 / standard deviation; 0 for a constant input.
    factor: Array1<A>,
}

/// A [`Scaler`] from outside, before it is known to make sense.
#[derive(Deserialize)]
#[serde(bound = "")]
struct Parts<A: Scalar> {
    mean: Array1<A>,
    factor: Array1<A>,
}

impl<A: Scalar> TryFrom<Parts<A>> for Scaler<A> {
    type Error = Error;

    fn try_from(Parts { mean, factor }: Parts<A>) -> Result<Self> {
        check_length("factors of the scaler", factor.len(), mean.len())?;
        for vector in [&mean, &factor] {
            check_matrix("the scaler", vector.view().insert_axis(Axis(0)))?;
        }
        Ok(Self { mean, factor })
    }
}

impl<A: Scalar> Scaler<A> {
    /// Measures the columns of `x`, shape (rows, inputs), as a fit does with its training rows.
    ///
    /// # Errors
    /// [`Error::Empty`] and [`Error::NotFinite`].
    pub fn measured(x: &ArrayRef2<A>) -> Result<Self> {
        check_matrix("inputs", x.view())?;
        Ok(Self::measure(x.view()))
    }

    /// From the mean and standard deviation of each input, known beforehand. An input of deviation
    /// 0 is taken for constant.
    ///
    /// # Errors
    /// [`Error::Empty`] without inputs, [`Error::Shape`] when the lengths differ,
    /// [`Error::NotFinite`], and [`Error::Parameter`] for a negative deviation.
    pub fn new(mean: &ArrayRef1<A>, deviation: &ArrayRef1<A>) -> Result<Self> {
        check_length("deviations", deviation.len(), mean.len())?;
        check_matrix("means", mean.view().insert_axis(Axis(0)))?;
        check_matrix("deviations", deviation.view().insert_axis(Axis(0)))?;
        if let Some(bad) = deviation.iter().find(|d| **d < A::zero()) {
            return Err(Error::Parameter {
                name: "deviation",
                value: bad.as_f64(),
                expected: "not negative",
            });
        }
        let factor = deviation.mapv(|d| {
            let factor = d.recip();
            if factor.is_finite() {
                factor
            } else {
                A::zero()
            }
        });
        Ok(Self {
            mean: mean.to_owned(),
            factor,
        })
    }

    /// Measures the columns of `x`, shape (rows, inputs), which must be finite and not empty.
    pub(crate) fn measure(x: ArrayView2<'_, A>) -> Self {
        let n = A::from_f64(x.nrows() as f64);
        let zeros = || Array1::<A>::zeros(x.ncols());
        // Row by row, so that the sums of all columns grow side by side.
        let mut unit = zeros();
        for row in x.rows() {
            Zip::from(&mut unit)
                .and(row)
                .for_each(|largest, &x| *largest = largest.max(x.abs()));
        }
        unit.mapv_inplace(power_of_two);
        let into_range = unit.mapv(A::recip);
        let mut mean = zeros();
        for row in x.rows() {
            Zip::from(&mut mean)
                .and(row)
                .and(&into_range)
                .for_each(|sum, &x, &factor| *sum += x * factor);
        }
        mean /= n;
        let mut variance = zeros();
        for row in x.rows() {
            Zip::from(&mut variance)
                .and(row)
                .and(&into_range)
                .and(&mean)
                .for_each(|sum, &x, &factor, &mean| {
                    let apart = x * factor - mean;
                    *sum += apart * apart;
                });
        }
        variance /= n;
        let factor =
            Zip::from(&variance)
                .and(&mean)
                .and(&unit)
                .map_collect(|variance, mean, &unit| {
                    let deviation = variance.sqrt();
                    let factor = (deviation * unit).recip();
                    // Below this the spread is rounding of a constant.
                    let constant = deviation <= A::from_f64(8.0) * A::epsilon() * mean.abs();
                    if constant || !factor.is_finite() {
                        A::zero()
                    } else {
                        factor
                    }
                });
        mean *= &unit;
        Self { mean, factor }
    }

    /// The standardised inputs, shape (rows, inputs).
    pub(crate) fn transform(&self, x: ArrayView2<'_, A>) -> Array2<A> {
        let mut out = x.to_owned();
        for mut row in out.rows_mut() {
            Zip::from(&mut row)
                .and(&self.mean)
                .and(&self.factor)
                .for_each(|x, &mean, &factor| {
                    *x = if factor == A::zero() {
                        A::zero()
                    } else {
                        (*x - mean) * factor
                    };
                });
        }
        out
    }

    /// Standardises inputs in place, each a slice of its values.
    pub(crate) fn transform_columns<'a>(&self, columns: impl Iterator<Item = &'a mut [A]>) {
        for ((column, &mean), &factor) in columns.zip(&self.mean).zip(&self.factor) {
            if factor == A::zero() {
                column.fill(A::zero());
            } else {
                // Mean and factor are not folded into the weights: where the mean is large
                // against the deviation, that would lose the digits that the difference keeps.
                column.iter_mut().for_each(|x| *x = (*x - mean) * factor);
            }
        }
    }

    /// Mean of each input.
    #[must_use]
    pub fn mean(&self) -> ArrayView1<'_, A> {
        self.mean.view()
    }

    /// What each centred input is multiplied by; 0 for an input that was constant.
    #[must_use]
    pub fn factor(&self) -> ArrayView1<'_, A> {
        self.factor.view()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn columns_get_mean_zero_and_deviation_one() {
        let x = array![[1.0, -5.0], [2.0, 5.0], [6.0, 15.0]];
        let z = Scaler::measure(x.view()).transform(x.view());
        for column in z.columns() {
            approx::assert_abs_diff_eq!(column.sum(), 0.0, epsilon = 1e-14);
            approx::assert_abs_diff_eq!(column.mapv(|v| v * v).sum(), 3.0, epsilon = 1e-13);
        }
    }

    #[test]
    fn scaling_a_column_by_any_power_of_ten_changes_nothing() {
        let x = array![[1.0], [2.0], [6.0], [-3.0]];
        let z = Scaler::measure(x.view()).transform(x.view());
        for power in [-300, -150, -8, 6, 150, 300] {
            let scaled = x.mapv(|v: f64| v * 10.0_f64.powi(power));
            let again = Scaler::measure(scaled.view()).transform(scaled.view());
            approx::assert_abs_diff_eq!(again, z, epsilon = 1e-13);
        }
    }

    #[test]
    fn a_constant_column_is_ignored_even_where_it_later_changes() {
        let x = array![[0.1, 1.0], [0.1, 2.0], [0.1, 3.0]];
        let scaler = Scaler::<f64>::measure(x.view());
        let z = scaler.transform(array![[1e9, 2.0]].view());
        assert_eq!(z[[0, 0]], 0.0);
    }
}
