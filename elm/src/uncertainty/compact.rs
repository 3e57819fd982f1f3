//! A network with its uncertainty and without the training rows, which fits in a file.

#[cfg(feature = "serde")]
use ndarray::aview2;
use ndarray::{Array, Array1, Array2, ArrayRef2, Axis, Ix2, Zip};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

#[cfg(feature = "serde")]
use crate::check::{check_finite, check_length};
use crate::cross_validation::Posterior;
use crate::dataset::{Inputs, TargetDim};
use crate::error::{Error, Result};
use crate::network::Elm;
use crate::scalar::Scalar;

/// A fitted network with what [deviations](Self::predict_deviation) and [intervals](Self::predict_interval)
/// need, but not the rows; made by [`UncertainElm::compact`](super::UncertainElm::compact). In files, as
/// [`Elm`] is.
///
/// Keeps the square of the neurons in numbers beside the network, and one for each training row and output.
///
/// ```
/// use elm::{Dataset, ElmParams, persist, uncertainty::CompactUncertainElm};
/// use ndarray::{Array1, Axis, Ix1, array};
///
/// let x = Array1::linspace(-3.0, 3.0, 80).insert_axis(Axis(1));
/// let t = x.column(0).mapv(|x: f64| x.sin() + 0.1 * (37.0 * x).sin());
/// let model = ElmParams::new(20).fit_uncertain(&Dataset::new(&x, &t)?)?.compact();
/// let bytes = persist::to_bytes(&model)?;
/// let again: CompactUncertainElm<f64, Ix1> = persist::from_bytes(&bytes)?;
/// let (low, high) = again.predict_interval(&array![[1.0]], 0.8)?;
/// assert!(low[0] < 0.84 && 0.84 < high[0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "Parts<A, D>"))]
pub struct CompactUncertainElm<A: Scalar, D: TargetDim = Ix2> {
    /// The mean of the members, the member itself where there is one.
    pub(super) model: Elm<A, D>,
    pub(super) members: Vec<Member<A, D>>,
    /// Sizes of leave-one-out residuals over the deviation of a new observation at their rows, in units of
    /// the noise, of the rows that count, rising in each column: shape (rows, outputs). Where rows were left
    /// out in groups the sizes themselves.
    pub(super) scores: Array2<A>,
    pub(super) is_studentized: bool,
    /// Estimated standard deviation of the noise, per output.
    pub(super) noise: Array1<A>,
    /// Mean square slope of each output along each input of the layer over the training rows, shape
    /// (inputs, outputs).
    pub(super) steepness: Array2<A>,
    /// The mean weight of rows over the largest.
    pub(super) mean_weight: A,
}

/// One of the networks whose mean is predicted.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", deny_unknown_fields))]
pub(super) struct Member<A: Scalar, D: TargetDim> {
    pub(super) model: Elm<A, D>,
    pub(super) posterior: Posterior<A>,
}

impl<A: Scalar, D: TargetDim> Member<A, D> {
    /// What the posterior adds to the variance of a new observation, in units of the noise's, shape
    /// (rows, outputs); `hidden` is this member's hidden-layer matrix.
    pub(super) fn spread(&self, hidden: &Array2<A>) -> Array2<A> {
        let lambda = &self.model.diagnosis().lambda;
        self.posterior.variance_factor(hidden, lambda)
    }
}

/// A [`CompactUncertainElm`] from outside, before its parts are known to fit together.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
#[serde(bound = "", deny_unknown_fields)]
struct Parts<A: Scalar, D: TargetDim> {
    model: Elm<A, D>,
    members: Vec<Member<A, D>>,
    scores: Array2<A>,
    is_studentized: bool,
    noise: Array1<A>,
    steepness: Array2<A>,
    mean_weight: A,
}

#[cfg(feature = "serde")]
impl<A: Scalar, D: TargetDim> TryFrom<Parts<A, D>> for CompactUncertainElm<A, D> {
    type Error = Error;

    fn try_from(parts: Parts<A, D>) -> Result<Self> {
        let (inputs, outputs) = (parts.model.inputs(), parts.model.outputs());
        if parts.members.is_empty() {
            return Err(Error::Parameter {
                name: "members",
                value: 0.0,
                expected: "at least 1",
            });
        }
        for Member { model, posterior } in &parts.members {
            check_length("inputs of a member", model.inputs(), inputs)?;
            check_length("outputs of a member", model.outputs(), outputs)?;
            check_length("strengths", model.diagnosis().lambda.len(), outputs)?;
            posterior.check(model.beta().nrows())?;
        }
        check_length("columns of scores", parts.scores.ncols(), outputs)?;
        check_length("deviations of the noise", parts.noise.len(), outputs)?;
        check_length("rows of slopes", parts.steepness.nrows(), inputs)?;
        check_length("columns of slopes", parts.steepness.ncols(), outputs)?;
        check_finite("scores", parts.scores.view())?;
        check_finite("slopes", parts.steepness.view())?;
        check_finite("deviations", parts.noise.view().insert_axis(Axis(0)))?;
        check_finite("mean weight", aview2(&[[parts.mean_weight]]))?;
        Ok(Self {
            model: parts.model,
            members: parts.members,
            scores: parts.scores,
            is_studentized: parts.is_studentized,
            noise: parts.noise,
            steepness: parts.steepness,
            mean_weight: parts.mean_weight,
        })
    }
}

impl<A: Scalar, D: TargetDim> CompactUncertainElm<A, D> {
    /// The network; of an ensemble the mean of its members.
    #[must_use]
    pub fn model(&self) -> &Elm<A, D> {
        &self.model
    }

    /// The standard deviation of a new observation: shape (rows, inputs) to (rows, outputs). Of an
    /// ensemble an upper bound: its variance is taken to be the mean of the members' variances, as
    /// if they all erred alike.
    ///
    /// # Errors
    /// Those of [`Elm::hidden_matrix`]; [`Error::Overflow`].
    pub fn predict_deviation<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array<A, D>> {
        let x = x.as_matrix();
        let mut deviation = self.variance(&x)?.mapv_into(A::sqrt) * &self.noise;
        deviation.zip_mut_with(&self.change_outside(&x), |d, &change| *d = d.hypot(change));
        finite(deviation).map(D::of_matrix)
    }

    /// Lower and upper ends of intervals that cover a new observation with about this probability: shape
    /// (rows, inputs) to two of (rows, outputs). With too few training rows for the coverage asked for (fewer
    /// than $1 / (1 - \text{coverage}) - 1$) they are infinite.
    ///
    /// The prediction plus and minus a quantile of the leave-one-out residuals: the jackknife, where
    /// [`UncertainElm::predict_interval`](super::UncertainElm::predict_interval) has the jackknife+. Where
    /// leaving out a row changes little, as under ridge, the two are alike; the guarantee is the latter's.
    ///
    /// # Errors
    /// [`Error::Parameter`] unless `coverage` lies strictly between 0 and 1; [`Error::Overflow`]; those of
    /// [`Elm::predict`].
    pub fn predict_interval<X: Inputs<A> + ?Sized>(
        &self,
        x: &X,
        coverage: f64,
    ) -> Result<(Array<A, D>, Array<A, D>)> {
        let rows = self.scores.nrows();
        let outside = rows_outside(coverage, rows)?;
        let x = x.as_matrix();
        let center = self.model.predict_matrix(&x)?;
        if outside == 0 {
            let low = Array2::from_elem(center.dim(), A::neg_infinity());
            let high = Array2::from_elem(center.dim(), A::infinity());
            return Ok((D::of_matrix(low), D::of_matrix(high)));
        }
        let mut half = if self.is_studentized {
            self.variance(&x)?.mapv_into(A::sqrt)
        } else {
            Array2::ones(center.dim())
        };
        half *= &self.scores.row(rows - outside);
        half.scaled_add(A::from_f64(EDGES), &self.change_outside(&x));
        let half = finite(half)?;
        Ok((D::of_matrix(&center - &half), D::of_matrix(center + half)))
    }

    /// The variance of a new observation in units of the noise's, shape (rows, outputs).
    fn variance(&self, x: &ArrayRef2<A>) -> Result<Array2<A>> {
        let hidden = self
            .members
            .iter()
            .map(|member| member.model.hidden_matrix(x));
        Ok(self.variance_of(&hidden.collect::<Result<Vec<_>>>()?))
    }

    /// The same of each member's hidden-layer matrix.
    pub(super) fn variance_of(&self, hidden: &[Array2<A>]) -> Array2<A> {
        let share = A::from_f64(self.members.len() as f64).recip();
        let rows = hidden.first().map_or(0, Array2::nrows);
        let mut variance = Array2::ones((rows, self.model.outputs()));
        for (member, hidden) in self.members.iter().zip(hidden) {
            variance.scaled_add(share * self.mean_weight, &member.spread(hidden));
        }
        variance
    }

    /// What each output may change by, as a root mean square, between the edge of the data and rows
    /// that lie outside; 0 for rows inside.
    pub(super) fn change_outside(&self, x: &ArrayRef2<A>) -> Array2<A> {
        let mut change = Array2::zeros((x.nrows(), self.model.outputs()));
        let Some(bounds) = self.model.bounds() else {
            return change;
        };
        let mut excess = bounds.excess(x);
        if let Some(scaler) = self.model.scaler() {
            excess *= &scaler.factor();
        }
        let outside = |row: &usize| excess.row(*row).iter().any(|e| *e > A::zero());
        let outside: Vec<usize> = (0..x.nrows()).filter(outside).collect();
        let rows = x.select(Axis(0), &outside);
        let gradients = self.model.gradients(&rows);
        let columns = change.columns_mut().into_iter();
        let outputs = gradients.zip(self.steepness.columns()).zip(columns);
        for ((gradient, steepness), mut change) in outputs {
            for (slopes, &row) in gradient.rows().into_iter().zip(&outside) {
                let squares = Zip::from(slopes)
                    .and(steepness)
                    .and(excess.row(row))
                    .fold(A::zero(), |sum, &slope, &usual, &e| {
                        sum + (slope * slope).max(usual) * e * e
                    });
                change[row] = squares.sqrt();
            }
        }
        change
    }
}

/// How many times what an output may change by outside of the data either end of an interval is moved.
pub(super) const EDGES: f64 = 6.0;

/// How many of n rows lie outside of an interval's end: $\lfloor \alpha (n + 1) \rfloor$.
pub(super) fn rows_outside(coverage: f64, rows: usize) -> Result<usize> {
    if !(coverage > 0.0 && coverage < 1.0) {
        return Err(Error::Parameter {
            name: "coverage",
            value: coverage,
            expected: "above 0 and below 1",
        });
    }
    let outside = ((1.0 - coverage) * (rows as f64 + 1.0) + 1e-9).floor() as usize;
    // A coverage near 0 would leave out more ends than there are.
    Ok(outside.min(rows))
}

pub(super) fn finite<A: Scalar>(values: Array2<A>) -> Result<Array2<A>> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err(Error::Overflow {
            what: "a standard deviation",
        })
    }
}
