//! Classifiers from rows that arrive in pieces.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use super::calibration::Calibration;
use super::labels::{LabeledRows, targets};
use super::left_out::without;
use super::{ElmClassifier, Parts, outputs};
use crate::accumulate::Accumulator;
#[cfg(feature = "serde")]
use crate::check::check_length;
use crate::dataset::{Dataset, Inputs};
use crate::error::{Error, Result};
use crate::feature_map::Scaler;
use crate::model::ElmParams;
use crate::scalar::Scalar;

/// Rows that are kept for the calibration, at most.
const KEPT: usize = 2000;

/// An [`Accumulator`] for a classifier: rows in, a triangle kept, and at most 2000 rows to calibrate
/// probabilities by. Pieces may lack classes, which are named beforehand.
///
/// Which rows are kept depends on the rows alone, so that the order of pieces and of merges changes
/// nothing but rounding.
///
/// ```
/// use elm::ElmParams;
/// use elm::classify::ClassAccumulator;
/// use ndarray::array;
///
/// let sample = array![[0.0], [2.0]];
/// let params = ElmParams::new(10);
/// let mut rows = ClassAccumulator::from_sample(&params, &sample, &["low", "mid", "high"])?;
/// rows.push(&array![[0.0], [0.1], [0.2]], &["low", "low", "low"])?;
/// rows.push(&array![[1.0], [1.1], [1.9], [2.0]], &["mid", "mid", "high", "high"])?;
/// let model = rows.fit()?;
/// assert_eq!(model.predict(&array![[0.05], [1.95]])?, ["low", "high"]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        bound(
            serialize = "L: Serialize",
            deserialize = "L: Ord + Clone + serde::de::DeserializeOwned"
        ),
        try_from = "Saved<A, L>"
    )
)]
pub struct ClassAccumulator<A: Scalar, L> {
    pub(super) rows: Accumulator<A>,
    classes: Vec<L>,
    kept: Vec<Kept<A>>,
    /// Whether rows of each class have been there.
    seen: Vec<bool>,
}

/// A row that is kept.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Kept<A: Scalar> {
    /// The rows of the lowest are kept.
    priority: u64,
    inputs: Vec<A>,
    code: usize,
    weight: A,
}

/// A [`ClassAccumulator`] from outside.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound(deserialize = "L: serde::de::DeserializeOwned"))]
struct Saved<A: Scalar, L> {
    rows: Accumulator<A>,
    classes: Vec<L>,
    kept: Vec<Kept<A>>,
    seen: Vec<bool>,
}

#[cfg(feature = "serde")]
impl<A: Scalar, L: Ord> TryFrom<Saved<A, L>> for ClassAccumulator<A, L> {
    type Error = Error;

    fn try_from(saved: Saved<A, L>) -> Result<Self> {
        let Saved {
            rows,
            classes,
            kept,
            seen,
        } = saved;
        check_classes(&classes)?;
        check_length("classes seen", seen.len(), classes.len())?;
        check_length(
            "outputs of a classifier",
            rows.outputs(),
            outputs(classes.len()),
        )?;
        for row in &kept {
            check_length("inputs of a kept row", row.inputs.len(), rows.inputs())?;
            let numbers = row.inputs.iter().chain([&row.weight]);
            if row.code >= classes.len() || numbers.into_iter().any(|v| !v.is_finite()) {
                return Err(Error::UnknownClass { row: row.code });
            }
        }
        Ok(Self {
            rows,
            classes,
            kept,
            seen,
        })
    }
}

fn check_classes<L: Ord>(classes: &[L]) -> Result<()> {
    if classes.len() < 2 || classes.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(Error::OneClass);
    }
    Ok(())
}

impl<A: Scalar, L: Ord + Clone> ClassAccumulator<A, L> {
    /// Draws the layer for rows like those of `x`; see [`Accumulator::from_sample`].
    ///
    /// # Errors
    /// [`Error::OneClass`] for fewer than two classes, and those of [`Accumulator::from_sample`].
    pub fn from_sample<X: Inputs<A> + ?Sized>(
        params: &ElmParams<A>,
        x: &X,
        classes: &[L],
    ) -> Result<Self> {
        let params = params.clone().for_classes();
        Self::new(classes, |outputs| {
            Accumulator::from_sample(&params, x, outputs)
        })
    }

    /// With inputs standardized by `scaler`; see [`Accumulator::with_scaler`].
    ///
    /// # Errors
    /// [`Error::OneClass`] for fewer than two classes, and those of [`Accumulator::with_scaler`].
    pub fn with_scaler(params: &ElmParams<A>, scaler: Scaler<A>, classes: &[L]) -> Result<Self> {
        let params = params.clone().for_classes();
        Self::new(classes, |outputs| {
            Accumulator::with_scaler(&params, scaler, outputs)
        })
    }

    fn new(classes: &[L], rows: impl FnOnce(usize) -> Result<Accumulator<A>>) -> Result<Self> {
        let mut classes = classes.to_vec();
        classes.sort_unstable();
        classes.dedup();
        check_classes(&classes)?;
        Ok(Self {
            rows: rows(outputs(classes.len()))?,
            kept: Vec::new(),
            seen: vec![false; classes.len()],
            classes,
        })
    }

    /// Whether rows may be unlike those that the scaler was measured on; see
    /// [`Accumulator::with_unlike_rows`].
    #[must_use]
    pub fn with_unlike_rows(mut self, allowed: bool) -> Self {
        self.rows = self.rows.with_unlike_rows(allowed);
        self
    }

    /// The classes, rising.
    #[must_use]
    pub fn classes(&self) -> &[L] {
        &self.classes
    }

    /// Number of rows so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows.rows()
    }

    /// Takes in rows. No rows is fine, and so is a piece without some of the classes.
    ///
    /// # Errors
    /// [`Error::UnknownClass`] naming the first row of a class that was not named beforehand, and those of
    /// [`Accumulator::push`]. After an error nothing has been taken in.
    #[doc(alias = "partial_fit")]
    pub fn push<X: Inputs<A> + ?Sized>(&mut self, x: &X, labels: &[L]) -> Result<()> {
        let rows = LabeledRows::with_classes(x, labels, &self.classes)?;
        self.push_labeled(&rows)
    }

    /// As [`push`](Self::push), of rows that may have weights.
    ///
    /// # Errors
    /// Those of [`push`](Self::push); [`Error::Mismatch`] for rows of other classes than those named.
    pub fn push_labeled(&mut self, rows: &LabeledRows<'_, A, L>) -> Result<()> {
        if rows.classes() != self.classes {
            return Err(Error::Mismatch { what: "classes" });
        }
        let targets = targets(rows.codes(), self.classes.len());
        let weights = rows.weights();
        let data = Dataset::of_views(rows.inputs(), targets.view());
        match &weights {
            Some(weights) => self.rows.push_dataset(&data.with_weights(weights)?)?,
            None => self.rows.push_dataset(&data)?,
        }
        for (row, (inputs, &code)) in rows
            .inputs()
            .rows()
            .into_iter()
            .zip(rows.codes())
            .enumerate()
        {
            let weight = weights.as_ref().map_or(A::one(), |weights| weights[row]);
            if weight > A::zero() {
                self.seen[code] = true;
                self.keep(Kept {
                    priority: priority(inputs, code),
                    inputs: inputs.to_vec(),
                    code,
                    weight,
                });
            }
        }
        self.drop_the_rest(KEPT);
        Ok(())
    }

    /// Takes in all that `other` has taken in.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for other classes, and those of [`Accumulator::merge`].
    pub fn merge(&mut self, other: &Self) -> Result<()> {
        if self.classes != other.classes {
            return Err(Error::Mismatch { what: "classes" });
        }
        self.rows.merge(&other.rows)?;
        for (seen, also) in self.seen.iter_mut().zip(&other.seen) {
            *seen |= also;
        }
        self.kept.extend(other.kept.iter().cloned());
        self.drop_the_rest(KEPT);
        Ok(())
    }

    /// Makes a file of it smaller; see [`Accumulator::compact`].
    ///
    /// # Errors
    /// Those of [`Accumulator::compact`].
    pub fn compact(&mut self) -> Result<()> {
        self.rows.compact()
    }

    /// Lets all rows so far count less; see [`Accumulator::forget`].
    ///
    /// # Errors
    /// Those of [`Accumulator::forget`].
    pub fn forget(&mut self, factor: f64) -> Result<()> {
        self.rows.forget(factor)?;
        let less = A::from_f64(factor);
        self.kept.iter_mut().for_each(|row| row.weight *= less);
        self.kept.retain(|row| row.weight > A::zero());
        if factor == 0.0 {
            self.seen.fill(false);
        }
        Ok(())
    }

    fn keep(&mut self, row: Kept<A>) {
        self.kept.push(row);
        if self.kept.len() >= 4 * KEPT {
            self.drop_the_rest(KEPT);
        }
    }

    fn drop_the_rest(&mut self, count: usize) {
        if self.kept.len() > count {
            self.kept.sort_by_key(|row| row.priority);
            self.kept.truncate(count);
        }
    }

    /// The classifier of all rows so far. More may be pushed afterwards.
    ///
    /// # Errors
    /// [`Error::OneClass`] while rows of one class alone have been there, and those of [`Accumulator::fit`].
    pub fn fit(&self) -> Result<ElmClassifier<A, L>> {
        if self.seen.iter().filter(|seen| **seen).count() == 1 {
            return Err(Error::OneClass);
        }
        let model = self.rows.fit()?;
        let shape = (self.kept.len(), self.rows.inputs());
        let inputs = self.kept.iter().flat_map(|row| row.inputs.iter().copied());
        let x = Array2::from_shape_vec(shape, inputs.collect());
        let x = x.map_err(|_| Error::Mismatch { what: "inputs" })?;
        let lambda = model.diagnosis().lambda[0];
        let units = self.rows.unit_leverages(x.view(), lambda)?;
        let scores = self.scores_without(&model, x.view(), &units);
        let codes: Vec<usize> = self.kept.iter().map(|row| row.code).collect();
        let weights: Array1<f64> = self.kept.iter().map(|row| row.weight.as_f64()).collect();
        let calibration = Calibration::fit(
            scores.view(),
            &codes,
            Some(weights.view()),
            self.classes.len(),
        );
        ElmClassifier::try_from(Parts {
            model,
            classes: self.classes.clone(),
            calibration,
        })
    }

    fn scores_without(
        &self,
        model: &crate::network::Elm<A>,
        x: ArrayView2<'_, A>,
        units: &Array1<A>,
    ) -> Array2<f64> {
        let fitted = model.map().apply(x).dot(&model.beta()) + model.intercept();
        let codes: Vec<usize> = self.kept.iter().map(|row| row.code).collect();
        let targets: Array2<A> = targets(&codes, self.classes.len());
        Array2::from_shape_fn(fitted.dim(), |(row, output)| {
            let leverage = units[row].as_f64() * self.kept[row].weight.as_f64().min(1.0);
            let (target, fitted) = (targets[[row, output]], fitted[[row, output]]);
            without(target.as_f64(), fitted.as_f64(), leverage)
        })
    }
}

/// A number that depends on the row alone, as good as random: the steps of SplitMix64 (Steele, Lea and Flood,
/// 2014) over its values.
fn priority<A: Scalar>(inputs: ArrayView1<'_, A>, code: usize) -> u64 {
    let mut state = code as u64;
    for value in inputs {
        state = (state ^ value.as_f64().to_bits()).wrapping_add(0x9e37_79b9_7f4a_7c15);
        state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^= state >> 31;
    }
    state
}
