//! Sums, means and deviations that are right to a few roundings however many rows there are.
//! Whatever in this crate takes a mean takes it from here.
//!
//! Sums are compensated: each addition's rounding error is kept and added at the end (Ogita, Rump
//! and Oishi, Accurate Sum and Dot Product, SIAM Journal on Scientific Computing 26(6), 2005,
//! algorithm `Sum2`), so that $n$ terms cost $u \lvert s \rvert + n^2 u^2 \sum \lvert x_i \rvert$ and not
//! $n u \sum \lvert x_i \rvert$, with $u$ the roundoff of `f64`, which is what everything is summed in.
//! Deviations take a second pass about the mean, corrected for the mean's own error, and those of
//! several blocks of rows are pooled exactly (Chan, Golub and `LeVeque`, Algorithms for Computing the
//! Sample Variance, The American Statistician 37(3), 1983).
//!
//! A column counts as constant where its values are equal, not where its deviation is small: a
//! threshold would either miss constants, whose mean rounds, or swallow inputs that vary little
//! beside their mean.

#[cfg(test)]
mod tests;

use ndarray::{ArrayView1, ArrayView2};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::scalar::{Scalar, power_of_two};

/// A compensated sum.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub(crate) struct Sum {
    high: f64,
    /// What rounding took from `high`.
    low: f64,
}

impl Sum {
    pub(crate) fn add(&mut self, term: f64) {
        let (high, lost) = two_sum(self.high, term);
        self.high = high;
        self.low += lost;
    }

    /// The sum; infinite or NaN where a term, or the sum on its way, was out of range.
    pub(crate) fn value(self) -> f64 {
        self.high + self.low
    }

    /// The sum divided by a power of two.
    fn scaled(self, factor: f64) -> Self {
        Self {
            high: self.high * factor,
            low: self.low * factor,
        }
    }

    #[cfg(any(feature = "serde", test))]
    fn is_finite(self) -> bool {
        self.high.is_finite() && self.low.is_finite()
    }
}

impl FromIterator<f64> for Sum {
    fn from_iter<T: IntoIterator<Item = f64>>(terms: T) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

/// The sum of all terms.
pub(crate) fn sum(terms: impl IntoIterator<Item = f64>) -> f64 {
    terms.into_iter().collect::<Sum>().value()
}

/// $a + b$ rounded, and what rounding took from it (Knuth, The Art of Computer Programming, volume
/// 2, section 4.2.2, theorem B).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_in_sum = sum - a;
    (sum, (a - (sum - b_in_sum)) + (b - b_in_sum))
}

/// The mean of each column with these weights, which must not be negative; 0 of rows that all have
/// weight 0.
pub(crate) fn means<A: Scalar, W: Scalar>(
    matrix: ArrayView2<'_, A>,
    weights: ArrayView1<'_, W>,
) -> Vec<f64> {
    let columns = matrix.ncols();
    // Apart, so that the sums of several columns are taken at once.
    let (mut high, mut low) = (vec![0.0; columns], vec![0.0; columns]);
    let mut total = Sum::default();
    for (row, weight) in matrix.rows().into_iter().zip(weights) {
        let weight = weight.as_f64();
        total.add(weight);
        for ((high, low), value) in high.iter_mut().zip(&mut low).zip(row) {
            let (sum, lost) = two_sum(*high, weight * value.as_f64());
            *high = sum;
            *low += lost;
        }
    }
    let total = match total.value() {
        0.0 => 1.0,
        total => total,
    };
    let sums = high.into_iter().zip(low);
    sums.map(|(high, low)| (high + low) / total).collect()
}

/// What is known of one column: enough for its mean and deviation, and to go on from there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub(crate) struct Column {
    least: f64,
    most: f64,
    /// Whether a value lies between the two.
    between: bool,
    /// A power of two of the size of the largest value, which keeps squares in range: the rest is in
    /// units of it.
    unit: f64,
    mean: f64,
    /// What rounding took from the mean.
    mean_low: f64,
    /// The weighted sum of squares about the mean.
    squares: Sum,
}

impl Column {
    const NOTHING: Self = Self {
        least: 0.0,
        most: 0.0,
        between: false,
        unit: 1.0,
        mean: 0.0,
        mean_low: 0.0,
        squares: Sum {
            high: 0.0,
            low: 0.0,
        },
    };

    /// Whether all values are equal.
    pub(crate) fn is_constant(&self) -> bool {
        self.least == self.most
    }

    /// Whether there are two values and no more.
    pub(crate) fn is_two_valued(&self) -> bool {
        !self.is_constant() && !self.between
    }

    /// Half the distance of the largest from the smallest value.
    pub(crate) fn half_range(&self) -> f64 {
        if self.is_constant() {
            return 0.0;
        }
        // Halved first: the distance may be out of range.
        self.most / 2.0 - self.least / 2.0
    }

    /// The mean; that of equal values is their value, to the last bit.
    pub(crate) fn mean(&self) -> f64 {
        if self.is_constant() {
            return self.least;
        }
        (self.unit * (self.mean + self.mean_low)).clamp(self.least, self.most)
    }

    fn deviation(&self, weight: f64) -> f64 {
        if self.is_constant() {
            return 0.0;
        }
        let deviation = self.unit * (self.squares.value().max(0.0) / weight).sqrt();
        if deviation > 0.0 {
            deviation
        } else {
            // All but rows of vanishing weight are equal.
            self.half_range()
        }
    }

    /// Joins another column's rows, the weights of both in one unit.
    fn join(&mut self, other: &Self, own: f64, others: f64) {
        let unit = self.unit.max(other.unit);
        let (here, there) = (self.unit / unit, other.unit / unit);
        let apart = (other.mean * there - self.mean * here)
            + (other.mean_low * there - self.mean_low * here);
        let share = others / (own + others);
        let (mean, lost) = two_sum(self.mean * here, apart * share);
        let mean_low = self.mean_low * here + lost;
        let mut squares = self.squares.scaled(here * here);
        squares.add(other.squares.value() * there * there);
        squares.add(apart * apart * own * share);
        let values = [self.least, self.most, other.least, other.most];
        let least = self.least.min(other.least);
        let most = self.most.max(other.most);
        let between = values.iter().any(|&value| least < value && value < most);
        *self = Self {
            least,
            most,
            between: between || self.between || other.between,
            unit,
            mean,
            mean_low,
            squares,
        };
    }

    #[cfg(any(feature = "serde", test))]
    fn is_sound(&self) -> bool {
        let finite = [self.least, self.most, self.unit, self.mean, self.mean_low];
        finite.iter().all(|value| value.is_finite())
            && self.squares.is_finite()
            && self.unit > 0.0
            && self.least <= self.most
    }
}

/// Means and deviations of columns over rows that may come block by block. Rows of weight 0 are no
/// rows.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub(crate) struct Moments {
    /// Rows of positive weight.
    rows: u64,
    /// A power of two that weights are in units of.
    weight_unit: f64,
    weight: Sum,
    columns: Vec<Column>,
}

impl Moments {
    /// Of no rows.
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            rows: 0,
            weight_unit: 1.0,
            weight: Sum::default(),
            columns: vec![Column::NOTHING; columns],
        }
    }

    /// Of these rows, whose values must be finite, and whose weights, where there are any, must be
    /// finite and not negative.
    pub(crate) fn of<A: Scalar>(x: ArrayView2<'_, A>, weights: Option<ArrayView1<'_, A>>) -> Self {
        let largest = |weights: ArrayView1<'_, A>| {
            let largest = weights.iter().fold(A::zero(), |m, w| m.max(*w));
            power_of_two(largest.as_f64())
        };
        let weight_unit = weights.map_or(1.0, largest);
        let weight = |row: usize| match weights {
            Some(weights) => weights[row].as_f64() / weight_unit,
            None => 1.0,
        };
        let rows = || {
            let rows = x.rows().into_iter().enumerate();
            rows.map(|(row, values)| (values, weight(row)))
                .filter(|(_, weight)| *weight > 0.0)
        };
        let mut moments = Self {
            weight_unit,
            ..Self::new(x.ncols())
        };
        let columns = &mut moments.columns;
        for (row, weight) in rows() {
            let first = moments.rows == 0;
            moments.rows += 1;
            moments.weight.add(weight);
            for (column, value) in columns.iter_mut().zip(row) {
                let value = value.as_f64();
                if first {
                    (column.least, column.most) = (value, value);
                }
                column.least = column.least.min(value);
                column.most = column.most.max(value);
            }
        }
        if moments.rows == 0 {
            return Self::new(x.ncols());
        }
        for column in columns.iter_mut() {
            let largest = column.least.abs().max(column.most.abs());
            // Zeros have no size: any other rows they are joined with give them theirs.
            column.unit = power_of_two(largest.max(f64::MIN_POSITIVE));
        }
        let total = moments.weight.value();
        let into_range: Vec<f64> = columns.iter().map(|c| c.unit.recip()).collect();
        let mut sums = vec![Sum::default(); columns.len()];
        for (row, weight) in rows() {
            let parts = columns.iter_mut().zip(&mut sums).zip(&into_range);
            for (((column, sum), factor), value) in parts.zip(row) {
                let value = value.as_f64();
                column.between |= column.least < value && value < column.most;
                sum.add(weight * (value * factor));
            }
        }
        for (column, sum) in columns.iter_mut().zip(sums) {
            column.mean = sum.value() / total;
        }
        let mut sums = vec![Sum::default(); columns.len()];
        for (row, weight) in rows() {
            let parts = columns.iter_mut().zip(&mut sums).zip(&into_range);
            for (((column, sum), factor), value) in parts.zip(row) {
                let apart = value.as_f64() * factor - column.mean;
                sum.add(weight * apart);
                column.squares.add(weight * apart * apart);
            }
        }
        for (column, sum) in columns.iter_mut().zip(sums) {
            // What the mean has missed, and what that has added to the squares.
            column.mean_low = sum.value() / total;
            column.squares.add(-sum.value() * column.mean_low);
        }
        moments
    }

    /// Joins the rows of `other`, which must have as many columns.
    pub(crate) fn merge(&mut self, other: &Self) {
        if other.rows == 0 {
            return;
        }
        if self.rows == 0 {
            self.clone_from(other);
            return;
        }
        let unit = self.weight_unit.max(other.weight_unit);
        let (here, there) = (self.weight_unit / unit, other.weight_unit / unit);
        self.weight = self.weight.scaled(here);
        let (own, others) = (self.weight.value(), other.weight.value() * there);
        for (column, other) in self.columns.iter_mut().zip(&other.columns) {
            column.squares = column.squares.scaled(here);
            let mut other = *other;
            other.squares = other.squares.scaled(there);
            if own + others > 0.0 {
                column.join(&other, own, others);
            }
        }
        self.weight.add(others);
        self.weight_unit = unit;
        self.rows = self.rows.saturating_add(other.rows);
    }

    /// Rows of positive weight.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    pub(crate) fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The standard deviation of each column, with the sum of the weights for divisor; 0 of a
    /// constant.
    pub(crate) fn deviations(&self) -> impl Iterator<Item = f64> + '_ {
        let weight = self.weight.value();
        self.columns.iter().map(move |c| c.deviation(weight))
    }

    /// Whether moments from outside can be those of some rows.
    #[cfg(any(feature = "serde", test))]
    pub(crate) fn is_sound(&self) -> bool {
        let empty = self.rows == 0;
        let weight = self.weight.value();
        let weighted = self.weight_unit > 0.0 && self.weight_unit.is_finite();
        weighted
            && if empty {
                self.weight == Sum::default() && self.columns.iter().all(|c| *c == Column::NOTHING)
            } else {
                weight > 0.0 && self.weight.is_finite() && self.columns.iter().all(Column::is_sound)
            }
    }
}
