//! From settings to a fitted network: [`ElmParams`] to [`CheckedParams`] to [`Elm`].

use ndarray::{Array1, Array2, ArrayBase, ArrayRef2, ArrayView1, ArrayView2, Axis, Data, Ix1, Ix2};
use serde::{Deserialize, Serialize};

use crate::activation::Activation;
use crate::error::{Error, Result};
use crate::hidden::{Distribution, HiddenLayer};
use crate::predictor::Predictor;
use crate::scalar::Scalar;
use crate::scaler::Scaler;
use crate::solve::{Diagnosis, LeastSquares, Solution, Solver, check_length, check_matrix};

/// Settings of an extreme learning machine. Setters never fail; [`check`](Self::check) and
/// [`fit`](Self::fit) say what is out of range.
///
/// # Parameters
///
/// | name | default | purpose | range |
/// |---|---|---|---|
/// | `neurons` | (required) | size of the random layer | at least 1 |
/// | [`activation`](Self::activation) | sigmoid | the function $f$ of equation 7 | |
/// | [`distribution`](Self::distribution) | uniform | what weights and biases are drawn from | |
/// | [`scale`](Self::scale) | 1 | multiplies the random weights: how nonlinear the network is, and its most influential setting | positive |
/// | [`bias_scale`](Self::bias_scale) | as `scale` | multiplies the random biases | not negative |
/// | [`seed`](Self::seed) | 0 | which random layer | |
/// | [`solver`](Self::solver) | ridge by leave-one-out | how output weights are found | |
/// | [`intercept`](Self::intercept) | on, but off for `Inverse` | an unpenalised constant per output | |
/// | [`standardise`](Self::standardise) | on | inputs to mean 0, deviation 1 over the training rows | |
/// | [`direct_links`](Self::direct_links) | off | inputs also reach the outputs directly (RVFL) | |
///
/// # Example
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 200).insert_axis(Axis(1));
/// let t = x.mapv(f64::sin);
/// let model = ElmParams::new(30).seed(1).fit(&x, &t)?;
/// let error = elm::metrics::rmse(&model.predict(&x)?.column(0), &t.column(0))?;
/// assert!(error < 1e-3);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct ElmParams<A: Scalar> {
    neurons: usize,
    activation: Activation<A>,
    distribution: Distribution,
    scale: f64,
    bias_scale: Option<f64>,
    seed: u64,
    solver: Solver,
    intercept: Option<bool>,
    standardise: bool,
    direct_links: bool,
}

impl<A: Scalar> ElmParams<A> {
    /// The defaults, with this many hidden neurons.
    #[must_use]
    pub fn new(neurons: usize) -> Self {
        Self {
            neurons,
            activation: Activation::default(),
            distribution: Distribution::default(),
            scale: 1.0,
            bias_scale: None,
            seed: 0,
            solver: Solver::default(),
            intercept: None,
            standardise: true,
            direct_links: false,
        }
    }

    /// The activation function of the hidden neurons.
    #[must_use]
    pub fn activation(mut self, activation: Activation<A>) -> Self {
        self.activation = activation;
        self
    }

    /// The distribution of hidden weights and biases.
    #[must_use]
    pub fn distribution(mut self, distribution: Distribution) -> Self {
        self.distribution = distribution;
        self
    }

    /// Multiplies the random weights, and the biases unless [`bias_scale`](Self::bias_scale) is
    /// set.
    #[must_use]
    pub fn scale(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    /// Multiplies the random biases.
    #[must_use]
    pub fn bias_scale(mut self, bias_scale: f64) -> Self {
        self.bias_scale = Some(bias_scale);
        self
    }

    /// Seeds the random layer. One seed gives one layer, on every platform.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// How the output weights are found: [`Inverse`](crate::solve::Inverse),
    /// [`PseudoInverse`](crate::solve::PseudoInverse) or [`Ridge`](crate::solve::Ridge).
    #[must_use]
    pub fn solver(mut self, solver: impl Into<Solver>) -> Self {
        self.solver = solver.into();
        self
    }

    /// Whether each output has a constant that is not penalised.
    #[must_use]
    pub fn intercept(mut self, intercept: bool) -> Self {
        self.intercept = Some(intercept);
        self
    }

    /// Whether inputs are brought to mean 0 and standard deviation 1 first.
    #[must_use]
    pub fn standardise(mut self, standardise: bool) -> Self {
        self.standardise = standardise;
        self
    }

    /// Whether the (standardised) inputs stand beside the hidden neurons in the linear solve: a
    /// random vector functional link network (Pao, Park and Sobajic, 1994).
    #[must_use]
    pub fn direct_links(mut self, direct_links: bool) -> Self {
        self.direct_links = direct_links;
        self
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first setting that is out of range.
    pub fn check(self) -> Result<CheckedParams<A>> {
        let parameter = |name, value, expected| {
            Err(Error::Parameter {
                name,
                value,
                expected,
            })
        };
        if self.neurons == 0 {
            return parameter("neurons", 0.0, "at least 1");
        }
        // Written so that NaN fails too.
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return parameter("scale", self.scale, "positive and finite");
        }
        if let Some(value) = self.bias_scale
            && !(value >= 0.0 && value.is_finite())
        {
            return parameter("bias_scale", value, "finite and not negative");
        }
        self.solver.check()?;
        Ok(CheckedParams(self))
    }

    /// Checks the settings and fits; see [`CheckedParams::fit`].
    ///
    /// # Errors
    /// Those of [`check`](Self::check) and [`CheckedParams::fit`].
    pub fn fit<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<Elm<A>> {
        self.clone().check()?.fit(x, t)
    }
}

/// Settings that are in range; made by [`ElmParams::check`].
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedParams<A: Scalar>(ElmParams<A>);

impl<A: Scalar> CheckedParams<A> {
    /// Draws the hidden layer and solves for the output weights.
    ///
    /// `x` has shape (rows, inputs); `t` has shape (rows, outputs), or (rows) for one output.
    ///
    /// # Errors
    /// [`Error::Empty`], [`Error::Shape`] and [`Error::NotFinite`] for the data, and those of
    /// [`Solver::solve`].
    pub fn fit<T: Targets<A>>(&self, x: &ArrayRef2<A>, t: &T) -> Result<Elm<A>> {
        self.fit_weighted(x, t, None)
    }

    /// As [`fit`](Self::fit), with a weight for the squared residual of each row.
    ///
    /// Standardisation does not use the weights.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) and [`LeastSquares::weights`].
    pub fn fit_weighted<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Elm<A>> {
        let params = &self.0;
        let (x, t) = (x.view(), t.as_matrix());
        check_matrix("inputs", x)?;
        check_matrix("targets", t)?;
        check_length("rows of targets", t.nrows(), x.nrows())?;

        let scaler = params.standardise.then(|| Scaler::measure(x));
        let hidden = HiddenLayer::draw(
            x.ncols(),
            params.neurons,
            params.distribution,
            params.scale,
            params.bias_scale.unwrap_or(params.scale),
            params.activation.clone(),
            params.seed,
        );
        let design = design(scaler.as_ref(), &hidden, params.direct_links, x);
        // Equation 10 has no room for a constant; asking for both explicitly is an error.
        let inverse = matches!(params.solver, Solver::Inverse(_));
        let mut problem =
            LeastSquares::new(&design, &t)?.intercept(params.intercept.unwrap_or(!inverse));
        if let Some(weights) = &weights {
            problem = problem.weights(weights)?;
        }
        let Solution {
            beta,
            intercept,
            diagnosis,
        } = params.solver.solve(&problem)?;
        Ok(Elm {
            scaler,
            hidden,
            direct_links: params.direct_links,
            beta,
            intercept,
            diagnosis,
        })
    }

    /// The settings.
    #[must_use]
    pub fn params(&self) -> &ElmParams<A> {
        &self.0
    }
}

/// Standardise, project, activate, and append the inputs where they are linked directly.
fn design<A: Scalar>(
    scaler: Option<&Scaler<A>>,
    hidden: &HiddenLayer<A>,
    direct_links: bool,
    x: ArrayView2<'_, A>,
) -> Array2<A> {
    let scaled = scaler.map(|scaler| scaler.transform(x));
    let x = scaled.as_ref().map_or(x, |scaled| scaled.view());
    let h = hidden.forward(x);
    if !direct_links {
        return h;
    }
    let mut both = Array2::zeros((x.nrows(), h.ncols() + x.ncols()));
    both.slice_mut(ndarray::s![.., ..h.ncols()]).assign(&h);
    both.slice_mut(ndarray::s![.., h.ncols()..]).assign(&x);
    both
}

/// A fitted network: $o(x) = \sum_k \beta_k f(\omega_k \cdot x + b_k)$ (equation 7) plus, where
/// set, an intercept and direct links. Made by [`ElmParams::fit`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Elm<A: Scalar> {
    scaler: Option<Scaler<A>>,
    hidden: HiddenLayer<A>,
    direct_links: bool,
    /// Shape (neurons, or neurons + inputs with direct links; outputs).
    beta: Array2<A>,
    intercept: Array1<A>,
    diagnosis: Diagnosis,
}

impl<A: Scalar> Elm<A> {
    /// Predicts every output for every row: shape (rows, inputs) to (rows, outputs).
    ///
    /// # Errors
    /// [`Error::Shape`] when the number of inputs differs from the training data's,
    /// [`Error::NotFinite`] for a NaN or infinity in `x`, [`Error::Overflow`] when a prediction is
    /// outside the range of the type. No rows is fine and gives no rows.
    pub fn predict(&self, x: &ArrayRef2<A>) -> Result<Array2<A>> {
        self.predictor().predict(x)
    }

    /// The network packed for evaluation: for many calls, few rows at a time, threads, or
    /// memory of the caller's own.
    #[must_use]
    pub fn predictor(&self) -> Predictor<A> {
        Predictor::new(self)
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.hidden.inputs()
    }

    /// Number of outputs.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.beta.ncols()
    }

    /// The random hidden layer.
    #[must_use]
    pub fn hidden(&self) -> &HiddenLayer<A> {
        &self.hidden
    }

    /// The standardisation of inputs, where it is on.
    #[must_use]
    pub fn scaler(&self) -> Option<&Scaler<A>> {
        self.scaler.as_ref()
    }

    /// The output weights $\beta$, shape (neurons, outputs); with direct links the inputs' rows
    /// follow the neurons'.
    #[must_use]
    pub fn beta(&self) -> ArrayView2<'_, A> {
        self.beta.view()
    }

    /// The constant added to each output.
    #[must_use]
    pub fn intercept(&self) -> ArrayView1<'_, A> {
        self.intercept.view()
    }

    /// Other output weights, for tests that compare networks in two precisions.
    #[cfg(test)]
    pub(crate) fn set_readout(&mut self, beta: Array2<A>, intercept: Array1<A>) {
        (self.beta, self.intercept) = (beta, intercept);
    }

    /// What the solver reported.
    #[must_use]
    pub fn diagnosis(&self) -> &Diagnosis {
        &self.diagnosis
    }
}

/// Training targets: a matrix of shape (rows, outputs), or a vector for a single output.
pub trait Targets<A: Scalar> {
    /// The targets with shape (rows, outputs).
    fn as_matrix(&self) -> ArrayView2<'_, A>;
}

impl<A: Scalar, S: Data<Elem = A>> Targets<A> for ArrayBase<S, Ix2> {
    fn as_matrix(&self) -> ArrayView2<'_, A> {
        self.view()
    }
}

impl<A: Scalar, S: Data<Elem = A>> Targets<A> for ArrayBase<S, Ix1> {
    fn as_matrix(&self) -> ArrayView2<'_, A> {
        self.view().insert_axis(Axis(1))
    }
}
