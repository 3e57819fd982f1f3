//! From settings to a fitted network: [`ElmParams`] to [`CheckedParams`] to [`Elm`].

mod checked;
mod rows;
mod settings;

use ndarray::{ArrayBase, ArrayRef1, ArrayRef2, ArrayView2, Axis, Data, Ix1, Ix2};

use crate::activation::Activation;
use crate::error::Result;
use crate::feature_map::{Biases, Distribution, FeatureMapParams, Kind, Neurons};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::Solver;
pub use checked::CheckedParams;
pub(crate) use checked::Drawn;
pub(crate) use rows::Rows;

/// Settings of an extreme learning machine. Setters never fail; [`check`](Self::check) and
/// [`fit`](Self::fit) say what is out of range.
///
/// # Parameters
///
/// | name | default | purpose | range |
/// |---|---|---|---|
/// | `neurons` | (required) | size of the random layer | at least 1 |
/// | [`activation`](Self::activation) | sigmoid | the function $f$ of equation 7 | |
/// | [`kind`](Self::kind) | projection | what the function is applied to: a weighted sum or a distance | |
/// | [`and`](Self::and) | none | neurons of other kinds beside these | scales positive |
/// | [`distribution`](Self::distribution) | uniform | what weights and biases are drawn from | |
/// | [`scale`](Self::scale) | 1 | multiplies the random weights: how nonlinear the network is, and its most influential setting | positive |
/// | [`input_scales`](Self::input_scales) | none | multiply the weights of each input | one per input, not negative |
/// | [`biases`](Self::biases) | drawn as the weights | where the biases come from | a scale must not be negative |
/// | [`seed`](Self::seed) | 0 | which random layer | |
/// | [`solver`](Self::solver) | ridge by leave-one-out | how output weights are found | |
/// | [`intercept`](Self::intercept) | on, but off for `Inverse` | an unpenalised constant per output | |
/// | [`standardise`](Self::standardise) | on | inputs to mean 0, deviation 1 over the training rows | |
/// | [`direct_links`](Self::direct_links) | off | inputs also reach the outputs directly (RVFL) | |
/// | [`bounded`](Self::bounded) | on | holds predictions outside the data to its [bounds](crate::bounds) | |
///
/// # Example
///
/// In JSON and the like settings have these names too, and those that are missing their defaults:
///
/// ```
/// use elm::{Activation, ElmParams};
///
/// let text = r#"{ "neurons": 20, "activation": "tanh", "solver": "pseudo-inverse" }"#;
/// let params: ElmParams<f64> = serde_json::from_str(text)?;
/// let same = ElmParams::new(20)
///     .activation(Activation::Tanh)
///     .solver(elm::solve::PseudoInverse::default());
/// assert_eq!(params, same);
/// # Ok::<(), serde_json::Error>(())
/// ```
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
#[derive(Debug, Clone, PartialEq)]
pub struct ElmParams<A: Scalar> {
    map: FeatureMapParams<A>,
    solver: Solver,
    intercept: Option<bool>,
    bounded: bool,
}

impl<A: Scalar> ElmParams<A> {
    /// The defaults, with this many hidden neurons.
    #[must_use]
    pub fn new(neurons: usize) -> Self {
        Self {
            map: FeatureMapParams::new(neurons),
            solver: Solver::default(),
            intercept: None,
            bounded: true,
        }
    }

    /// Another number of hidden neurons in all. Where there are several kinds, each keeps its share
    /// of them, to within one.
    #[must_use]
    pub fn with_neurons(mut self, neurons: usize) -> Self {
        let before = self.neurons();
        let (mut counted, mut given) = (0.0, 0);
        for group in self.map.groups_mut() {
            counted += group.count as f64;
            let up_to_here = if counted < before as f64 {
                (neurons as f64 * (counted / before as f64)).round() as usize
            } else {
                neurons
            };
            group.count = up_to_here.max(given) - given;
            given += group.count;
        }
        self
    }

    /// Number of neurons, of all kinds together.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.map.neurons()
    }

    /// What the feature map is drawn from.
    #[must_use]
    pub fn feature_map(&self) -> &FeatureMapParams<A> {
        &self.map
    }

    pub(crate) fn links_directly(&self) -> bool {
        self.map.direct_links
    }

    pub(crate) fn get_seed(&self) -> u64 {
        self.map.seed
    }

    /// The activation function of the hidden neurons.
    #[must_use]
    pub fn activation(mut self, activation: Activation<A>) -> Self {
        self.map.neurons.activation = activation;
        self
    }

    /// What the activation function is applied to.
    #[must_use]
    pub fn kind(mut self, kind: Kind) -> Self {
        self.map.neurons.kind = kind;
        self
    }

    /// Adds neurons of another kind to the layer. Everything but what [`Neurons`] sets they have in
    /// common with the others: the distribution, the [`scale`](Self::scale), which theirs multiplies,
    /// the [`input_scales`](Self::input_scales) and the seed.
    #[must_use]
    pub fn and(mut self, neurons: Neurons<A>) -> Self {
        self.map.others.push(neurons);
        self
    }

    /// The distribution of hidden weights and biases.
    #[must_use]
    pub fn distribution(mut self, distribution: Distribution) -> Self {
        self.map.distribution = distribution;
        self
    }

    /// Multiplies the random weights.
    #[must_use]
    pub fn scale(mut self, scale: f64) -> Self {
        self.map.scale = scale;
        self
    }

    /// Multiplies the weights of each input on top of [`scale`](Self::scale): 0 for an input that
    /// is to be ignored. Empty, the default, means 1 for all.
    #[must_use]
    pub fn input_scales(mut self, input_scales: Vec<f64>) -> Self {
        self.map.input_scales = input_scales;
        self
    }

    /// Where the random biases come from.
    #[must_use]
    pub fn biases(mut self, biases: Biases) -> Self {
        self.map.neurons.biases = biases;
        self
    }

    /// Seeds the random layer. One seed gives one layer, on every platform.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.map.seed = seed;
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
        self.map.standardise = standardise;
        self
    }

    /// Whether the (standardised) inputs stand beside the hidden neurons in the linear solve: a
    /// random vector functional link network (Pao, Park and Sobajic, 1994).
    #[must_use]
    pub fn direct_links(mut self, direct_links: bool) -> Self {
        self.map.direct_links = direct_links;
        self
    }

    /// Whether inputs beyond those of the training rows are held at the edge of their range, and
    /// predictions within the range of the training targets and a margin; see
    /// [`bounds`](crate::bounds). Off, a prediction outside the data is whatever the sum of the
    /// neurons comes to there.
    #[must_use]
    pub fn bounded(mut self, bounded: bool) -> Self {
        self.bounded = bounded;
        self
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) naming the first setting that is out of range.
    pub fn check(self) -> Result<CheckedParams<A>> {
        self.map.check()?;
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

/// Training targets: a matrix of shape (rows, outputs), or a vector for a single output.
pub trait Targets<A: Scalar> {
    /// The targets with shape (rows, outputs).
    fn as_matrix(&self) -> ArrayView2<'_, A>;
}

impl<A: Scalar> Targets<A> for ArrayRef2<A> {
    fn as_matrix(&self) -> ArrayView2<'_, A> {
        self.view()
    }
}

impl<A: Scalar> Targets<A> for ArrayRef1<A> {
    fn as_matrix(&self) -> ArrayView2<'_, A> {
        self.view().insert_axis(Axis(1))
    }
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
