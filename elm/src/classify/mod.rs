//! Classification: a network with an output for each class, and probabilities that are calibrated.
//!
//! Targets are 1 in the rows of a class and 0 in all others, and the output weights solve the same linear
//! system as in regression, with one ridge for all classes chosen by exact leave-one-out. What the network
//! then says of a row are scores. They become log-odds by one slope and a shift for each class, fitted by
//! Newton's method to the scores that each row has **without** itself, which the same factors give in closed
//! form: no second data set, and no row's probability is made from its own label.
//!
//! ```
//! use elm::ElmParams;
//! use ndarray::{Array2, array};
//!
//! // Two half circles.
//! let x = Array2::from_shape_fn((60, 2), |(i, j)| {
//!     let (angle, upper) = (i as f64 * 0.053, i % 2 == 0);
//!     match (j, upper) {
//!         (0, true) => angle.cos(),
//!         (0, false) => 1.0 - angle.cos(),
//!         (_, true) => angle.sin(),
//!         (_, false) => 0.5 - angle.sin(),
//!     }
//! });
//! let labels: Vec<&str> = (0..60).map(|i| if i % 2 == 0 { "upper" } else { "lower" }).collect();
//! let model = ElmParams::new(40).fit_classifier(&x, &labels)?;
//! let new = array![[0.0, 1.0], [1.0, -0.5]];
//! assert_eq!(model.predict(&new)?, ["upper", "lower"]);
//! // A column for each class, in the order of `model.classes()`.
//! let p = model.predict_proba(&new)?;
//! assert!(p[[0, 1]] > 0.9 && (p.row(0).sum() - 1.0_f64).abs() < 1e-12);
//! # Ok::<(), elm::Error>(())
//! ```

mod accumulate;
mod calibration;
#[cfg(feature = "persist")]
mod files;
mod fit;
mod labels;
mod left_out;
mod predictor;

use ndarray::{Array, Array2, Ix2};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

pub use accumulate::ClassAccumulator;
pub use calibration::Calibration;
pub use fit::{PrunedClassifier, TunedClassifier};
pub use labels::{ClassWeights, LabeledRows};
pub use predictor::ClassPredictor;

use crate::check::check_length;
use crate::dataset::Inputs;
use crate::error::{Error, Result};
use crate::network::Elm;
use crate::scalar::Scalar;

/// A fitted classifier: a network with a score for each class (of two classes, for the second), and what
/// makes probabilities of scores. Made by [`ElmParams::fit_classifier`](crate::ElmParams::fit_classifier).
///
/// `L` is the type of labels: numbers, texts, an enum of your own. Equal settings and seeds give the same
/// classifier whatever labels are called, as classes are numbered in their order.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::array;
///
/// let x = array![[0.0], [0.2], [0.4], [1.0], [1.2], [1.4]];
/// let model = ElmParams::new(10).fit_classifier(&x, &[7, 7, 7, 3, 3, 3])?;
/// assert_eq!(model.classes(), [3, 7]);
/// assert_eq!(model.predict(&array![[0.1], [1.3]])?, [7, 3]);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        bound(
            serialize = "L: Serialize",
            deserialize = "L: Ord + serde::de::DeserializeOwned"
        ),
        try_from = "Parts<A, L>"
    )
)]
pub struct ElmClassifier<A: Scalar, L> {
    model: Elm<A>,
    classes: Vec<L>,
    calibration: Calibration,
}

/// An [`ElmClassifier`] from outside, before its parts are known to fit together.
#[cfg_attr(feature = "serde", derive(Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(deserialize = "L: serde::de::DeserializeOwned"))
)]
struct Parts<A: Scalar, L> {
    model: Elm<A>,
    classes: Vec<L>,
    calibration: Calibration,
}

impl<A: Scalar, L: Ord> TryFrom<Parts<A, L>> for ElmClassifier<A, L> {
    type Error = Error;

    fn try_from(parts: Parts<A, L>) -> Result<Self> {
        let Parts {
            model,
            classes,
            calibration,
        } = parts;
        if classes.len() < 2 || classes.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(Error::Parameter {
                name: "classes",
                value: classes.len() as f64,
                expected: "at least 2, rising",
            });
        }
        check_length(
            "outputs of a classifier",
            model.outputs(),
            outputs(classes.len()),
        )?;
        calibration.check(classes.len())?;
        Ok(Self {
            model,
            classes,
            calibration,
        })
    }
}

/// Outputs of a network for this many classes.
fn outputs(classes: usize) -> usize {
    if classes == 2 { 1 } else { classes }
}

impl<A: Scalar, L: Ord + Clone> ElmClassifier<A, L> {
    /// The most probable class of each row.
    ///
    /// # Errors
    /// Those of [`Elm::predict`].
    pub fn predict<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Vec<L>> {
        let codes = self.predictor().predict_codes(x)?;
        Ok(codes
            .into_iter()
            .map(|code| self.classes[code].clone())
            .collect())
    }

    /// The log-odds of each class, shape (rows, classes), up to a number common to a row; of two classes
    /// those of the second against the first, shape (rows, 1). The largest is predicted, of two classes the
    /// second above 0.
    ///
    /// # Errors
    /// Those of [`Elm::predict`].
    pub fn decision_function<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array2<A>> {
        self.predictor().decision_function(x)
    }

    /// The probability of each class, shape (rows, classes): never NaN, at least 0, and 1 in sum over a row
    /// to within rounding.
    ///
    /// # Errors
    /// Those of [`Elm::predict`].
    pub fn predict_proba<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array<A, Ix2>> {
        self.predictor().predict_proba(x)
    }

    /// The share of rows whose label is predicted.
    ///
    /// # Errors
    /// Those of [`predict`](Self::predict); [`Error::Shape`] for another number of labels.
    #[doc(alias = "accuracy")]
    pub fn score<X: Inputs<A> + ?Sized>(&self, x: &X, labels: &[L]) -> Result<f64> {
        crate::metrics::accuracy(&self.predict(x)?, labels)
    }
}

impl<A: Scalar, L> ElmClassifier<A, L> {
    /// The classes, rising: the order of columns.
    #[must_use]
    pub fn classes(&self) -> &[L] {
        &self.classes
    }

    /// The network that gives scores, one output for each class; of two classes one for the second.
    #[must_use]
    pub fn model(&self) -> &Elm<A> {
        &self.model
    }

    /// What makes log-odds of scores.
    #[must_use]
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The weights packed for evaluation, without allocations and, where wanted, on several threads.
    #[must_use]
    pub fn predictor(&self) -> ClassPredictor<A> {
        ClassPredictor::new(&self.model, self.calibration.clone(), self.classes.len())
    }
}
