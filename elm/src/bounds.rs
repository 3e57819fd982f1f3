//! Where the training rows lie, and what predictions are held to outside of them.
//!
//! A network knows nothing of inputs that it was not fitted near. Sums of hundreds of neurons whose
//! large output weights cancel among the training rows do not cancel elsewhere, and predictions a
//! little outside the data are easily a thousand times too large. Unless
//! [`ElmParams::with_bounded`](crate::ElmParams::with_bounded) is switched off, a fitted network therefore
//!
//! - takes each input that lies beyond its training range for the nearest end of that range, so that
//!   a prediction outside is that at the edge of the data. Of inputs that are drawn alike, the next
//!   one lies a little beyond the largest so far, so the edge is [`EDGE`] of the range farther out;
//! - keeps predictions within the range of the training targets, wider by [`MARGIN`] of it on
//!   either side.
//!
//! Inside the data neither changes a fit or its held-out errors. What a network says outside is not
//! known to be right: [`Elm::distance_outside`](crate::Elm::distance_outside) tells which rows are, and
//! how far, and [deviations and intervals](crate::uncertainty) widen with that distance.

use ndarray::{Array1, Array2, ArrayRef2, ArrayView1, ArrayView2, Axis, Zip};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::check::{check_length, check_matrix};
use crate::error::{Error, Result};
use crate::feature_map::Scaler;
use crate::scalar::Scalar;

/// What a prediction may exceed the range of the training targets by, on either side, as a share of
/// that range: rows between the training rows may well be higher than all of them.
pub const MARGIN: f64 = 0.25;

/// How far beyond the training range an input is taken as it is, as a share of that range: rows that
/// were held out from between the others lie a little beyond the last of them.
pub const EDGE: f64 = 0.005;

/// The ranges of the training rows; see the [module](self).
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array1, Axis, array};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let model = ElmParams::new(20).fit(&x, &x.mapv(f64::sin))?;
/// let bounds = model.bounds().ok_or("a fitted network has them")?;
/// assert_eq!(bounds.inputs().0, array![-3.0]);
/// assert_eq!(bounds.held_inputs().1, array![3.0 + 0.005 * 6.0]);
/// assert!((bounds.predictions().1[0] - 1.5).abs() < 1e-2);
/// // Far outside, a prediction is that at the edge.
/// assert_eq!(model.predict(&array![[1e6]])?, model.predict(&array![[3.03]])?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "Parts<A>"))]
pub struct Bounds<A: Scalar> {
    inputs: Ranges<A>,
    targets: Ranges<A>,
    held: bool,
}

/// The least and the greatest value of each column.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Ranges<A: Scalar> {
    lower: Array1<A>,
    upper: Array1<A>,
}

/// [`Bounds`] from outside, before they are known to make sense.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound = "")]
struct Parts<A: Scalar> {
    inputs: Ranges<A>,
    targets: Ranges<A>,
    held: bool,
}

#[cfg(feature = "serde")]
impl<A: Scalar> TryFrom<Parts<A>> for Bounds<A> {
    type Error = Error;

    fn try_from(parts: Parts<A>) -> Result<Self> {
        let Parts {
            inputs,
            targets,
            held,
        } = parts;
        inputs.check("ranges of inputs")?;
        targets.check("ranges of targets")?;
        Ok(Self {
            inputs,
            targets,
            held,
        })
    }
}

impl<A: Scalar> Ranges<A> {
    /// Of the columns of a matrix that has rows; rows of weight 0 are left out.
    fn of(matrix: ArrayView2<'_, A>, weights: Option<ArrayView1<'_, A>>) -> Option<Self> {
        let counts = |row: &usize| weights.is_none_or(|weights| weights[*row] > A::zero());
        let mut rows = (0..matrix.nrows()).filter(counts);
        let first = matrix.row(rows.next()?).to_owned();
        let (mut lower, mut upper) = (first.clone(), first);
        for row in rows {
            Zip::from(&mut lower)
                .and(&mut upper)
                .and(matrix.row(row))
                .for_each(|lower, upper, &value| {
                    *lower = lower.min(value);
                    *upper = upper.max(value);
                });
        }
        Some(Self { lower, upper })
    }

    fn widen(&mut self, other: &Self) {
        self.lower.zip_mut_with(&other.lower, |a, &b| *a = a.min(b));
        self.upper.zip_mut_with(&other.upper, |a, &b| *a = a.max(b));
    }

    /// The ends, farther out by a share of the range.
    fn widened(&self, share: f64) -> (Array1<A>, Array1<A>) {
        let share = A::from_f64(share);
        // Each end by itself, as the range may be beyond the type's.
        let beyond = |end: A, other: A| {
            let wide = end + (end * share - other * share);
            wide.max(-A::max_value()).min(A::max_value())
        };
        let of = |ends: &Array1<A>, others: &Array1<A>| {
            Zip::from(ends)
                .and(others)
                .map_collect(|&end, &other| beyond(end, other))
        };
        (of(&self.lower, &self.upper), of(&self.upper, &self.lower))
    }

    #[cfg_attr(not(feature = "serde"), allow(dead_code))]
    fn check(&self, what: &'static str) -> Result<()> {
        check_length(what, self.upper.len(), self.lower.len())?;
        for ends in [&self.lower, &self.upper] {
            check_matrix(what, ends.view().insert_axis(Axis(0)))?;
        }
        let crossed = |(lower, upper): (&A, &A)| lower > upper;
        match self.lower.iter().zip(&self.upper).position(crossed) {
            Some(column) => Err(Error::Parameter {
                name: what,
                value: self.lower[column].as_f64(),
                expected: "lower ends that are not above the upper ones",
            }),
            None => Ok(()),
        }
    }
}

impl<A: Scalar> Bounds<A> {
    /// Of training rows, of which at least one counts: `x` and `t` have a row for each.
    pub(crate) fn of(
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
        held: bool,
    ) -> Option<Self> {
        Some(Self {
            inputs: Ranges::of(x, weights)?,
            targets: Ranges::of(t, weights)?,
            held,
        })
    }

    /// Takes in the rows of others of as many inputs and outputs.
    pub(crate) fn widen(&mut self, other: &Self) {
        self.inputs.widen(&other.inputs);
        self.targets.widen(&other.targets);
    }

    /// Whether these are of this many inputs and outputs.
    pub(crate) fn check(&self, inputs: usize, outputs: usize) -> Result<()> {
        check_length("ranges of inputs", self.inputs.lower.len(), inputs)?;
        check_length("ranges of targets", self.targets.lower.len(), outputs)
    }

    pub(crate) fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Whether predictions are held to them.
    #[must_use]
    pub fn are_held(&self) -> bool {
        self.held
    }

    /// The least and the greatest value of each input among the training rows.
    #[must_use]
    pub fn inputs(&self) -> (ArrayView1<'_, A>, ArrayView1<'_, A>) {
        (self.inputs.lower.view(), self.inputs.upper.view())
    }

    /// What inputs are held between: their ranges and [`EDGE`] of them on either side.
    #[must_use]
    pub fn held_inputs(&self) -> (Array1<A>, Array1<A>) {
        self.inputs.widened(EDGE)
    }

    /// The least and the greatest value of each output among the training rows.
    #[must_use]
    pub fn targets(&self) -> (ArrayView1<'_, A>, ArrayView1<'_, A>) {
        (self.targets.lower.view(), self.targets.upper.view())
    }

    /// What predictions of each output are held between: the targets' range and [`MARGIN`] of it on
    /// either side.
    #[must_use]
    pub fn predictions(&self) -> (Array1<A>, Array1<A>) {
        self.targets.widened(MARGIN)
    }

    /// Inputs, in place, each held to its range where they are held.
    pub(crate) fn hold_inputs(&self, x: &mut Array2<A>) {
        if !self.held {
            return;
        }
        hold(x, self.held_inputs());
    }

    /// Predictions, in place, each held to its range where they are held.
    pub(crate) fn hold_predictions(&self, y: &mut Array2<A>) {
        if self.held {
            hold(y, self.predictions());
        }
    }

    /// How far each input of each row lies beyond its range, in its own units, shape (rows,
    /// inputs).
    pub(crate) fn excess(&self, x: &ArrayRef2<A>) -> Array2<A> {
        let Ranges { lower, upper } = &self.inputs;
        let mut excess = x.to_owned();
        for mut row in excess.rows_mut() {
            Zip::from(&mut row)
                .and(lower)
                .and(upper)
                .for_each(|x, &lower, &upper| {
                    *x = (*x - upper).max(lower - *x).max(A::zero());
                });
        }
        excess
    }

    /// The Euclidean distance of each row from the box of the training inputs, each input in units
    /// of its deviation where a scaler knows that.
    pub(crate) fn distance(&self, x: &ArrayRef2<A>, scaler: Option<&Scaler<A>>) -> Array1<A> {
        let mut excess = self.excess(x);
        if let Some(scaler) = scaler {
            excess *= &scaler.factor();
        }
        excess.map_axis(Axis(1), |row| {
            let largest = row.iter().fold(A::zero(), |m: A, v| m.max(*v));
            if largest == A::zero() || !largest.is_finite() {
                return largest;
            }
            let squares = row.iter().map(|&v| (v / largest).powi(2));
            largest * squares.fold(A::zero(), |sum, v| sum + v).sqrt()
        })
    }
}

/// Values, each held between the ends of its column.
fn hold<A: Scalar>(values: &mut Array2<A>, (lower, upper): (Array1<A>, Array1<A>)) {
    for mut row in values.rows_mut() {
        Zip::from(&mut row)
            .and(&lower)
            .and(&upper)
            .for_each(|value, &lower, &upper| *value = value.max(lower).min(upper));
    }
}
