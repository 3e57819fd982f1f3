//! The packed evaluator of a classifier.

use ndarray::{Array2, ArrayRef2, s};

use super::calibration::{Calibration, both_classes, softmax};
use crate::activation::Accuracy;
use crate::check::check_length;
use crate::dataset::Inputs;
use crate::error::Result;
use crate::memory::check_room;
use crate::network::Elm;
use crate::predictor::{Predictor, Scratch};
use crate::scalar::Scalar;

/// A classifier's weights packed for evaluation; made by
/// [`ElmClassifier::predictor`](super::ElmClassifier::predictor). It knows classes by their indices.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array2, array};
///
/// let x = array![[0.0], [0.2], [0.4], [1.0], [1.2], [1.4]];
/// let model = ElmParams::new(10).fit_classifier(&x, &["a", "a", "a", "b", "b", "b"])?;
/// let predictor = model.predictor();
/// let (mut p, mut scratch) = (Array2::zeros((6, 2)), predictor.scratch());
/// predictor.predict_proba_into(&x, &mut p, &mut scratch)?;
/// assert_eq!(p, model.predict_proba(&x)?);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct ClassPredictor<A: Scalar> {
    scores: Predictor<A>,
    calibration: Calibration,
    classes: usize,
}

impl<A: Scalar> ClassPredictor<A> {
    pub(super) fn new(model: &Elm<A>, calibration: Calibration, classes: usize) -> Self {
        Self {
            scores: model.predictor(),
            calibration,
            classes,
        }
    }

    /// How exactly activation functions are evaluated; [`Accuracy::Full`] unless set.
    #[must_use]
    pub fn with_accuracy(mut self, accuracy: Accuracy) -> Self {
        self.scores = self.scores.with_accuracy(accuracy);
        self
    }

    /// Number of classes.
    #[must_use]
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.scores.inputs()
    }

    /// Working memory for this classifier.
    #[must_use]
    pub fn scratch(&self) -> Scratch<A> {
        self.scores.scratch()
    }

    /// Log-odds, as [`ElmClassifier::decision_function`](super::ElmClassifier::decision_function).
    ///
    /// # Errors
    /// Those of [`Predictor::predict`].
    pub fn decision_function<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array2<A>> {
        let mut scores = self.scores.predict(x)?;
        self.calibration.apply(&mut scores);
        Ok(scores)
    }

    /// The index of the most probable class of each row.
    ///
    /// # Errors
    /// Those of [`Predictor::predict`].
    pub fn predict_codes<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Vec<usize>> {
        Ok(codes(&self.decision_function(x)?))
    }

    /// Probabilities, shape (rows, classes).
    ///
    /// # Errors
    /// Those of [`Predictor::predict`].
    pub fn predict_proba<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array2<A>> {
        let x = x.as_matrix();
        check_room("the probabilities", x.nrows(), self.classes)?;
        let mut out = Array2::zeros((x.nrows(), self.classes));
        self.predict_proba_into(&x, &mut out, &mut self.scratch())?;
        Ok(out)
    }

    /// As [`predict_proba`](Self::predict_proba) into `out`, shape (rows, classes), without allocating.
    ///
    /// # Errors
    /// Those of [`Predictor::predict_into`].
    pub fn predict_proba_into(
        &self,
        x: &ArrayRef2<A>,
        out: &mut ArrayRef2<A>,
        scratch: &mut Scratch<A>,
    ) -> Result<()> {
        check_length("columns of probabilities", out.ncols(), self.classes)?;
        let columns = self.scores.outputs();
        self.scores
            .predict_into(x, &mut out.slice_mut(s![.., ..columns]), scratch)?;
        self.probabilities(out);
        Ok(())
    }

    /// As [`predict_proba_into`](Self::predict_proba_into) on several [threads](crate::on_threads); the
    /// same bits for any number of them.
    ///
    /// # Errors
    /// Those of [`Predictor::predict_into_parallel`].
    pub fn predict_proba_into_parallel(
        &self,
        x: &ArrayRef2<A>,
        out: &mut ArrayRef2<A>,
    ) -> Result<()> {
        check_length("columns of probabilities", out.ncols(), self.classes)?;
        let columns = self.scores.outputs();
        self.scores
            .predict_into_parallel(x, &mut out.slice_mut(s![.., ..columns]))?;
        self.probabilities(out);
        Ok(())
    }

    /// In place of scores, which stand in the first columns.
    fn probabilities(&self, out: &mut ArrayRef2<A>) {
        for mut row in out.rows_mut() {
            if self.classes == 2 {
                let z = self.calibration.of_second(row[0].as_f64());
                let (first, second) = both_classes(z);
                (row[0], row[1]) = (A::from_f64(first), A::from_f64(second));
                continue;
            }
            for (class, z) in row.iter_mut().enumerate() {
                *z = A::from_f64(self.calibration.of_class(class, z.as_f64()));
            }
            softmax(&mut row);
        }
    }
}

/// The class of the largest log-odds in each row, of equals the first.
fn codes<A: Scalar>(log_odds: &Array2<A>) -> Vec<usize> {
    let largest = |row: ndarray::ArrayView1<'_, A>| {
        if row.len() == 1 {
            return usize::from(row[0] > A::zero());
        }
        let better = |best: usize, class: usize| if row[class] > row[best] { class } else { best };
        (0..row.len()).fold(0, better)
    };
    log_odds.rows().into_iter().map(largest).collect()
}
