//! How far a prediction can be trusted.
//!
//! Two answers, from the factorisation that found the output weights:
//!
//! - [`UncertainElm::predict_deviation`]: the standard deviation of a new observation under the
//!   ridge posterior. With $\beta \sim N(0, \sigma^2 / \lambda)$ and noise $\sigma$ the variance at
//!   $x$ is $\sigma^2 (1 + 1/n + \tilde h(x)^T (\tilde H^T \tilde H + \lambda)^{-1} \tilde h(x))$,
//!   columns centred for the intercept (without one the $1/n$ goes too). $\sigma^2$ is estimated by
//!   the mean of residual times leave-one-out residual, which counts each squared residual by the
//!   freedom that its row kept. Cheap and smooth, right where noise is normal and even.
//! - [`UncertainElm::predict_interval`]: the jackknife+ of Barber, Candès, Ramdas and Tibshirani
//!   (Annals of Statistics 49(1), 2021), from exact leave-one-out residuals and the predictions of
//!   the $n$ networks that each leave out one row, all in closed form. Assumes nothing of the noise
//!   but that rows are exchangeable: an interval asked to cover $1 - \alpha$ covers at least
//!   $1 - 2\alpha$ always, and about $1 - \alpha$ in practice.
//!
//! Both take the random layer, its standardisation and $\lambda$ as given. Where the settings were
//! chosen on the same rows, errors are a little larger than either says.
//!
//! ```
//! use elm::ElmParams;
//! use ndarray::{Array1, Axis, array};
//!
//! let x = Array1::linspace(-3.0, 3.0, 80).insert_axis(Axis(1));
//! let t = x.mapv(|x: f64| x.sin() + 0.05 * (37.0 * x).sin());
//! let model = ElmParams::new(20).fit_uncertain(&x, &t)?;
//! let deviation = model.predict_deviation(&array![[0.0], [30.0]])?;
//! assert!(deviation[[0, 0]] < 0.1 && deviation[[1, 0]] > deviation[[0, 0]]);
//! let (low, high) = model.predict_interval(&array![[0.0]], 0.9)?;
//! assert!(low[[0, 0]] < 0.0 && high[[0, 0]] > 0.0);
//! # Ok::<(), elm::Error>(())
//! ```

use ndarray::{Array1, Array2, ArrayRef2, Axis, Zip};

use crate::error::{Error, Result};
use crate::model::{CheckedParams, ElmParams, Targets};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::Solver;
use crate::validate::Validator;

/// A fitted network that knows how far off it may be; made by [`ElmParams::fit_uncertain`].
///
/// Keeps one number per training row and neuron beside the network.
#[derive(Debug, Clone)]
pub struct UncertainElm<A: Scalar> {
    model: Elm<A>,
    validator: Validator<A>,
    /// Leave-one-out residuals, shape (rows, outputs).
    left_out: Array2<A>,
    /// Estimated standard deviation of the noise, per output.
    noise: Array1<A>,
}

impl<A: Scalar> ElmParams<A> {
    /// Fits, and keeps what [`uncertainty`](crate::uncertainty) needs.
    ///
    /// # Errors
    /// Those of [`check`](Self::check) and [`CheckedParams::fit_uncertain`].
    pub fn fit_uncertain<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<UncertainElm<A>> {
        self.clone().check()?.fit_uncertain(x, t)
    }
}

impl<A: Scalar> CheckedParams<A> {
    /// Fits, and keeps what [`uncertainty`](crate::uncertainty) needs. Factorises twice.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit); [`Error::Conflict`] unless the solver is ridge;
    /// [`Error::Undetermined`] when a row cannot be left out, as of a single one.
    pub fn fit_uncertain<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<UncertainElm<A>> {
        if !matches!(self.solver(), Solver::Ridge(_)) {
            return Err(Error::Conflict {
                first: "a solver other than ridge",
                second: "uncertainty",
            });
        }
        let model = self.fit(x, t)?;
        let hidden = model.hidden_matrix(x)?;
        let validator = Validator::new(&self.problem(&hidden, t.as_matrix(), None)?)?;
        let left_out = validator
            .leave_one_out(&model.diagnosis().lambda)?
            .residuals()
            .to_owned();
        let residuals = &t.as_matrix() - &model.predict(x)?;
        let rows = A::from_f64(residuals.nrows() as f64);
        let noise = Zip::from(residuals.columns())
            .and(left_out.columns())
            .map_collect(|r, l| {
                // Each product is a square over 1 - h, so only rounding can make it negative.
                (r.dot(&l).max(A::zero()) / rows).sqrt()
            });
        Ok(UncertainElm {
            model,
            validator,
            left_out,
            noise,
        })
    }
}

impl<A: Scalar> UncertainElm<A> {
    /// The network.
    #[must_use]
    pub fn model(&self) -> &Elm<A> {
        &self.model
    }

    /// The estimated standard deviation of the noise of each output.
    #[must_use]
    pub fn noise(&self) -> &Array1<A> {
        &self.noise
    }

    /// The standard deviation of a new observation: shape (rows, inputs) to (rows, outputs).
    ///
    /// # Errors
    /// Those of [`Elm::hidden_matrix`]; [`Error::Overflow`].
    pub fn predict_deviation(&self, x: &ArrayRef2<A>) -> Result<Array2<A>> {
        let hidden = self.model.hidden_matrix(x)?;
        let spread = self
            .validator
            .posterior_spread(&hidden, &self.model.diagnosis().lambda);
        let deviation = spread.mapv_into(|s| (A::one() + s).sqrt()) * &self.noise;
        finite(deviation)
    }

    /// Lower and upper ends of jackknife+ intervals that cover a new observation with about this
    /// probability: shape (rows, inputs) to two of (rows, outputs). With too few training rows
    /// for the coverage asked for (fewer than $1 / (1 - \text{coverage}) - 1$) they are infinite.
    ///
    /// Costs training rows x neurons for each row of `x`.
    ///
    /// # Errors
    /// [`Error::Parameter`] unless `coverage` lies strictly between 0 and 1; those of
    /// [`Elm::predict`].
    pub fn predict_interval(
        &self,
        x: &ArrayRef2<A>,
        coverage: f64,
    ) -> Result<(Array2<A>, Array2<A>)> {
        if !(coverage > 0.0 && coverage < 1.0) {
            return Err(Error::Parameter {
                name: "coverage",
                value: coverage,
                expected: "above 0 and below 1",
            });
        }
        let predicted = self.model.predict(x)?;
        let hidden = self.model.hidden_matrix(x)?;
        let rows = self.left_out.nrows();
        // The k-th smallest and largest of n ends, k = floor(alpha (n + 1)).
        let outside = ((1.0 - coverage) * (rows as f64 + 1.0) + 1e-9).floor() as usize;
        let mut low = Array2::from_elem(predicted.dim(), A::neg_infinity());
        let mut high = Array2::from_elem(predicted.dim(), A::infinity());
        if outside == 0 {
            return Ok((low, high));
        }
        let lambda = &self.model.diagnosis().lambda;
        let mut ends = vec![A::zero(); rows];
        for (output, left_out) in self.left_out.columns().into_iter().enumerate() {
            for (row, hidden) in hidden.axis_chunks_iter(Axis(0), 1).enumerate() {
                // How much the prediction here moves per unit of each left-out residual.
                let pull = self.validator.pull(&hidden, lambda[output]);
                let centre = predicted[[row, output]];
                let mut end = |sign: A| {
                    for ((end, &e), &a) in ends.iter_mut().zip(left_out).zip(&pull) {
                        *end = sign * (centre - e * a) - e.abs();
                    }
                    let (_, value, _) = ends.select_nth_unstable_by(outside - 1, |a, b| {
                        a.as_f64().total_cmp(&b.as_f64())
                    });
                    sign * *value
                };
                low[[row, output]] = end(A::one());
                high[[row, output]] = end(-A::one());
            }
        }
        Ok((low, high))
    }
}

fn finite<A: Scalar>(values: Array2<A>) -> Result<Array2<A>> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err(Error::Overflow {
            what: "a standard deviation",
        })
    }
}
