//! Standardization of inputs: mean 0 and standard deviation 1 over the training rows.

use std::marker::PhantomData;

use ndarray::{Array1, Array2, ArrayRef1, ArrayRef2, ArrayView1, ArrayView2, Axis, Zip};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::check::{check_length, check_matrix, check_some_weight, check_weights};
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::stats::Moments;

/// Subtracts each input's mean and divides by its standard deviation (with divisor $n$).
///
/// - An input that is constant over the training rows, all of its values being equal, carries no
///   information and is mapped to 0, whatever value it takes later.
/// - An input of two values is divided by their distance in place of its deviation, so that the two
///   are 1 apart however rare one of them is. A one among a thousand zeros would else lie at 32, where
///   every neuron is saturated. A category in columns of 0 and 1, one for each level, then counts as
///   one ordinary input, however many levels it has: rows of different levels are at a squared distance
///   of 2, as rows of an input of deviation 1 are in the mean.
///
/// Means and deviations are those of `f64` whatever the type, right to a few roundings however many
/// rows there are. Rows that do not stand in memory together are measured by a [`ScalerBuilder`].
///
/// ```
/// use elm::Scaler;
/// use ndarray::array;
///
/// let x = array![[0.0, 0.5, 0.0], [3.0, 0.5, 4.0], [0.0, 0.5, 0.0], [5.0, 0.5, 0.0]];
/// let scaler = Scaler::measured(&x)?;
/// assert_eq!(scaler.mean(), array![2.0, 0.5, 1.0]);
/// // The second input is constant, the third has two values.
/// assert_eq!(scaler.factor(), array![4.5_f64.sqrt().recip(), 0.0, 0.25]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "Parts<A>"))]
pub struct Scaler<A: Scalar> {
    mean: Array1<A>,
    /// 1 / standard deviation, or for two values 1 / their distance; 0 for a constant input.
    factor: Array1<A>,
}

/// A [`Scaler`] from outside, before it is known to make sense.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound = "")]
struct Parts<A: Scalar> {
    mean: Array1<A>,
    factor: Array1<A>,
}

#[cfg(feature = "serde")]
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
        Ok(Self::measure(x.view(), None))
    }

    /// As [`measured`](Self::measured), each row counting by its weight, as a weighted fit does: a
    /// row of weight 0 is no row, one of weight 2 is two, and a factor of all weights says nothing.
    ///
    /// # Errors
    /// Those of [`measured`](Self::measured); [`Error::Shape`] when there is not one weight per row,
    /// [`Error::Parameter`] when one is negative or not finite or when all are 0.
    pub fn measured_weighted(x: &ArrayRef2<A>, weights: &ArrayRef1<A>) -> Result<Self> {
        check_matrix("inputs", x.view())?;
        check_some_weight(weights.view(), x.nrows())?;
        Ok(Self::measure(x.view(), Some(weights.view())))
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
        Ok(Self {
            mean: mean.to_owned(),
            factor: deviation.mapv(|d| reciprocal(d.as_f64())),
        })
    }

    /// Measures the columns of `x`, shape (rows, inputs), which must be finite and not empty, with
    /// weights that are in range and not all 0.
    pub(crate) fn measure(x: ArrayView2<'_, A>, weights: Option<ArrayView1<'_, A>>) -> Self {
        Self::of_moments(&Moments::of(x, weights))
    }

    fn of_moments(moments: &Moments) -> Self {
        let columns = moments.columns().iter();
        let factor = columns.clone().zip(moments.deviations());
        Self {
            mean: columns.map(|column| A::from_f64(column.mean())).collect(),
            factor: factor
                .map(|(column, deviation)| {
                    if column.is_two_valued() {
                        // Not their distance, which may be out of range.
                        reciprocal::<A>(column.half_range()) / A::from_f64(2.0)
                    } else {
                        reciprocal(deviation)
                    }
                })
                .collect(),
        }
    }

    /// The standardized inputs, shape (rows, inputs).
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

    /// Standardizes inputs in place, each a slice of its values.
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

    /// What each centered input is multiplied by; 0 for an input that was constant.
    #[must_use]
    pub fn factor(&self) -> ArrayView1<'_, A> {
        self.factor.view()
    }
}

/// The factor for a deviation: 0 for none, and never infinite, as the deviations of subnormal
/// values would have it.
fn reciprocal<A: Scalar>(deviation: f64) -> A {
    if deviation > 0.0 {
        A::from_f64(deviation.recip()).min(A::max_value())
    } else {
        A::zero()
    }
}

/// Measures inputs chunk by chunk, for a [`Scaler`] of rows that never stand in memory together or
/// lie on several machines.
///
/// Means and deviations are pooled without loss: cutting and order of the rows make no difference but
/// in the last digits. Keeps a few numbers for each input.
///
/// ```
/// use elm::{Scaler, ScalerBuilder};
/// use ndarray::{array, s};
///
/// let x = array![[1.0, 0.5], [3.0, 0.5], [8.0, 0.5]];
/// let (mut one, mut other) = (ScalerBuilder::new(2)?, ScalerBuilder::new(2)?);
/// one.push(&x.slice(s![..2, ..]))?;
/// other.push(&x.slice(s![2.., ..]))?;
/// one.merge(&other)?;
/// assert_eq!(one.build()?.mean(), Scaler::measured(&x)?.mean());
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "BuilderParts"))]
pub struct ScalerBuilder<A: Scalar> {
    moments: Moments,
    #[cfg_attr(feature = "serde", serde(skip))]
    scalar: PhantomData<A>,
}

/// A [`ScalerBuilder`] from outside, before it is known to make sense.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
struct BuilderParts {
    moments: Moments,
}

#[cfg(feature = "serde")]
impl<A: Scalar> TryFrom<BuilderParts> for ScalerBuilder<A> {
    type Error = Error;

    fn try_from(BuilderParts { moments }: BuilderParts) -> Result<Self> {
        if moments.columns().is_empty() {
            return Err(NO_INPUTS);
        }
        if !moments.is_sound() {
            let what = "a moment of inputs";
            return Err(Error::Overflow { what });
        }
        let scalar = PhantomData;
        Ok(Self { moments, scalar })
    }
}

const NO_INPUTS: Error = Error::Empty {
    what: "moments of inputs",
    rows: 0,
    columns: 0,
};

impl<A: Scalar> ScalerBuilder<A> {
    /// For rows of this number of inputs.
    ///
    /// # Errors
    /// [`Error::Empty`] without inputs.
    pub fn new(inputs: usize) -> Result<Self> {
        if inputs == 0 {
            return Err(NO_INPUTS);
        }
        Ok(Self {
            moments: Moments::new(inputs),
            scalar: PhantomData,
        })
    }

    /// Takes in rows: `x` has shape (rows, inputs). No rows is fine.
    ///
    /// # Errors
    /// [`Error::Shape`] for another number of inputs, [`Error::NotFinite`]. After an error nothing
    /// has been taken in.
    pub fn push(&mut self, x: &ArrayRef2<A>) -> Result<()> {
        self.push_rows(x, None)
    }

    /// As [`push`](Self::push), each row counting by its weight.
    ///
    /// # Errors
    /// Those of [`push`](Self::push); [`Error::Shape`] when there is not one weight per row,
    /// [`Error::Parameter`] when one is negative or not finite.
    pub fn push_weighted(&mut self, x: &ArrayRef2<A>, weights: &ArrayRef1<A>) -> Result<()> {
        self.push_rows(x, Some(weights.view()))
    }

    fn push_rows(&mut self, x: &ArrayRef2<A>, weights: Option<ArrayView1<'_, A>>) -> Result<()> {
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        if let Some(weights) = weights {
            check_weights(weights, x.nrows())?;
        }
        if x.nrows() > 0 {
            check_matrix("inputs", x.view())?;
            self.moments.merge(&Moments::of(x.view(), weights));
        }
        Ok(())
    }

    /// Takes in all that `other` has taken in.
    ///
    /// # Errors
    /// [`Error::Shape`] for another number of inputs.
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        check_length("columns of inputs", other.inputs(), self.inputs())?;
        self.moments.merge(&other.moments);
        Ok(())
    }

    /// The scaler of all rows so far. More rows may be pushed afterwards.
    ///
    /// # Errors
    /// [`Error::Empty`] without rows of positive weight.
    pub fn build(&self) -> Result<Scaler<A>> {
        if self.rows() == 0 {
            return Err(Error::Empty {
                what: "inputs",
                rows: 0,
                columns: self.inputs(),
            });
        }
        Ok(Scaler::of_moments(&self.moments))
    }

    /// Rows of positive weight so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.moments.rows()
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.moments.columns().len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn columns_get_mean_zero_and_deviation_one() {
        let x = array![[1.0, -5.0], [2.0, 5.0], [6.0, 15.0]];
        let z = Scaler::measure(x.view(), None).transform(x.view());
        for column in z.columns() {
            approx::assert_abs_diff_eq!(column.sum(), 0.0, epsilon = 1e-14);
            approx::assert_abs_diff_eq!(column.mapv(|v| v * v).sum(), 3.0, epsilon = 1e-13);
        }
    }

    #[test]
    fn scaling_a_column_by_any_power_of_ten_changes_nothing() {
        let x = array![[1.0], [2.0], [6.0], [-3.0]];
        let z = Scaler::measure(x.view(), None).transform(x.view());
        for power in [-300, -150, -8, 6, 150, 300] {
            let scaled = x.mapv(|v: f64| v * 10.0_f64.powi(power));
            let again = Scaler::measure(scaled.view(), None).transform(scaled.view());
            approx::assert_abs_diff_eq!(again, z, epsilon = 1e-13);
        }
    }

    #[test]
    fn a_constant_column_is_ignored_even_where_it_later_changes() {
        let x = array![[0.1, 1.0], [0.1, 2.0], [0.1, 3.0]];
        let scaler = Scaler::<f64>::measure(x.view(), None);
        let z = scaler.transform(array![[1e9, 2.0]].view());
        assert_eq!(z[[0, 0]], 0.0);
    }

    #[test]
    fn a_rare_value_is_no_further_than_a_frequent_one() {
        for ones in [1, 10, 500, 999] {
            let x = Array2::from_shape_fn((1000, 1), |(row, _)| f64::from(u8::from(row < ones)));
            let scaler = Scaler::measure(x.view(), None);
            assert_eq!(scaler.factor(), array![1.0]);
            approx::assert_relative_eq!(scaler.mean()[0], ones as f64 / 1000.0);
        }
    }

    #[test]
    fn deviations_too_small_to_be_divided_by_are_no_constants() {
        let x = array![[0.0], [1e-310], [3e-310]];
        let factor = Scaler::measure(x.view(), None).factor().to_owned();
        assert_eq!(factor, array![f64::MAX]);
        assert_eq!(
            Scaler::new(&array![0.0], &array![1e-310]).unwrap().factor(),
            factor
        );
    }

    #[test]
    fn weights_are_repetitions_and_a_row_of_none_is_no_row() {
        let x = array![[1e6, 5.0], [1.0, 0.1], [2.0, 0.1], [6.0, 0.1]];
        let weighted = Scaler::measured_weighted(&x, &array![0.0, 1.0, 2.0, 1.0]).unwrap();
        let repeated = array![[1.0, 0.1], [2.0, 0.1], [2.0, 0.1], [6.0, 0.1]];
        let repeated = Scaler::measured(&repeated).unwrap();
        assert_eq!(weighted.mean(), repeated.mean());
        approx::assert_relative_eq!(weighted.factor(), repeated.factor(), max_relative = 1e-15);
        assert_eq!(weighted.factor()[1], 0.0);
        for weights in [
            array![0.0, 0.0, 0.0, 0.0],
            array![1.0],
            array![1.0, 1.0, 1.0, -1.0],
        ] {
            assert!(Scaler::measured_weighted(&x, &weights).is_err());
        }
    }

    #[test]
    fn what_a_builder_cannot_take_in_is_an_error_and_leaves_no_trace() {
        assert!(ScalerBuilder::<f64>::new(0).is_err());
        let mut builder = ScalerBuilder::new(2).unwrap();
        assert!(matches!(builder.build(), Err(Error::Empty { .. })));
        builder.push(&array![[1.0, 2.0], [4.0, 5.0]]).unwrap();
        let before = builder.clone();
        assert!(builder.push(&array![[1.0]]).is_err());
        assert!(builder.push(&array![[1.0, 0.0], [f64::NAN, 0.0]]).is_err());
        assert!(
            builder
                .push_weighted(&array![[1.0, 0.0]], &array![-1.0])
                .is_err()
        );
        assert!(builder.merge(&ScalerBuilder::new(1).unwrap()).is_err());
        builder.push(&Array2::zeros((0, 2))).unwrap();
        builder
            .push_weighted(&array![[9.0, 9.0]], &array![0.0])
            .unwrap();
        assert_eq!(builder, before);
        #[cfg(feature = "serde")]
        {
            let text = serde_json::to_string(&builder).unwrap();
            assert_eq!(
                serde_json::from_str::<ScalerBuilder<f64>>(&text).unwrap(),
                builder
            );
            let damaged = text.replace("\"unit\":4.0", "\"unit\":-4.0");
            assert_ne!(damaged, text);
            assert!(serde_json::from_str::<ScalerBuilder<f64>>(&damaged).is_err());
        }
    }
}
