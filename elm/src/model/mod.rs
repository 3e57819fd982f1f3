//! From settings to a fitted network: [`ElmParams`] to [`Elm`](crate::Elm).

mod fit;
#[cfg(feature = "serde")]
mod settings;

use crate::activation::Activation;
use crate::error::Result;
use crate::feature_map::{
    Biases, Distribution, Embedding, FeatureMapParams, NeuronGroup, NodeType,
};
use crate::scalar::Scalar;
use crate::solve::Solver;
pub(crate) use fit::Drawn;

/// Settings of an extreme learning machine, and the fits that are made with them. `with_NAME` writes a
/// setting and never fails, `NAME` reads it; [`fit`](Self::fit) and all other verbs say what is out of
/// range.
///
/// # Parameters
///
/// | name | default | purpose | range |
/// |---|---|---|---|
/// | [`neurons`](Self::with_neurons) | (required) | size of the random layer | at least 1 |
/// | [`activation`](Self::with_activation) | sigmoid | the function $f$ of equation 7 | |
/// | [`node_type`](Self::with_node_type) | additive | what the function is applied to: a weighted sum or a distance | |
/// | [`biases`](Self::with_biases) | drawn as the weights | where the biases come from | a scale must not be negative |
/// | [`groups`](Self::with_group) | none | further groups of neurons beside these | scales positive |
/// | [`distribution`](Self::with_distribution) | uniform | what weights and biases are drawn from | |
/// | [`scale`](Self::with_scale) | 1 | multiplies the random weights: how nonlinear the network is, and its most influential setting | positive |
/// | [`input_scales`](Self::with_input_scales) | none | multiply the weights of each input | one per input or ramp, not negative |
/// | [`seed`](Self::with_seed) | 0 | which random layer | |
/// | [`solver`](Self::with_solver) | ridge by leave-one-out | how output weights are found | |
/// | [`intercept`](Self::with_intercept) | on, but off for `Inverse` | an unpenalized constant per output | |
/// | [`standardize`](Self::with_standardize) | on | inputs to mean 0, deviation 1 over the training rows | |
/// | [`direct_links`](Self::with_direct_links) | off | inputs also reach the outputs directly (RVFL) | |
/// | [`embedding`](Self::with_embedding) | inputs alone | what neurons see of the inputs: ramps beside them | at least 1 |
/// | [`bounded`](Self::with_bounded) | on | holds predictions outside the data to its [bounds](crate::bounds) | |
///
/// # Example
///
/// ```
/// use elm::ElmParams;
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 200).insert_axis(Axis(1));
/// let t = x.column(0).mapv(f64::sin);
/// let model = ElmParams::new(30).with_seed(1).fit(&x, &t)?;
/// let error = elm::metrics::rmse(&model.predict(&x)?, &t)?;
/// assert!(error < 1e-3);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// In JSON and the like settings have these names, too, and those that are missing their defaults:
///
/// ```
/// # #[cfg(feature = "serde")] {
/// use elm::{Activation, ElmParams};
///
/// let text = r#"{ "neurons": 20, "activation": "tanh", "solver": "pseudo-inverse" }"#;
/// let params: ElmParams<f64> = serde_json::from_str(text)?;
/// let same = ElmParams::new(20)
///     .with_activation(Activation::Tanh)
///     .with_solver(elm::solve::PseudoInverse::default());
/// assert_eq!(params, same);
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
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

    /// Another number of hidden neurons in all. Where there are several groups, each keeps its share
    /// of them, to within one.
    #[must_use]
    #[doc(alias = "n_hidden")]
    #[doc(alias = "hidden_layer_sizes")]
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

    /// Number of neurons, of all groups together.
    #[must_use]
    pub fn neurons(&self) -> usize {
        self.map.neurons()
    }

    /// What the feature map is drawn from.
    #[must_use]
    pub fn feature_map(&self) -> &FeatureMapParams<A> {
        &self.map
    }

    /// The activation function of the hidden neurons.
    #[must_use]
    #[doc(alias = "activation_func")]
    pub fn with_activation(mut self, activation: Activation<A>) -> Self {
        self.map.neurons.activation = activation;
        self
    }

    /// The activation function of the hidden neurons (of the first group).
    #[must_use]
    pub fn activation(&self) -> &Activation<A> {
        self.map.neurons.activation()
    }

    /// What the activation function is applied to.
    #[must_use]
    pub fn with_node_type(mut self, node_type: NodeType) -> Self {
        self.map.neurons.node_type = node_type;
        self
    }

    /// What the activation function is applied to (in the first group).
    #[must_use]
    pub fn node_type(&self) -> NodeType {
        self.map.neurons.node_type()
    }

    /// Where the random biases come from.
    #[must_use]
    pub fn with_biases(mut self, biases: Biases) -> Self {
        self.map.neurons.biases = biases;
        self
    }

    /// Where the random biases come from (in the first group).
    #[must_use]
    pub fn biases(&self) -> Biases {
        self.map.neurons.biases()
    }

    /// Adds a group of other neurons to the layer. Everything but what [`NeuronGroup`] sets they have in
    /// common with the first: the distribution, the [`scale`](Self::with_scale), which theirs multiplies,
    /// the [`input_scales`](Self::with_input_scales) and the seed.
    #[must_use]
    pub fn with_group(mut self, neurons: NeuronGroup<A>) -> Self {
        self.map.others.push(neurons);
        self
    }

    /// The groups of neurons: the one that is set here, and those that were
    /// [added](Self::with_group).
    pub fn groups(&self) -> impl Iterator<Item = &NeuronGroup<A>> {
        self.map.groups()
    }

    /// The distribution of hidden weights and biases.
    #[must_use]
    pub fn with_distribution(mut self, distribution: Distribution) -> Self {
        self.map.distribution = distribution;
        self
    }

    /// The distribution of hidden weights and biases.
    #[must_use]
    pub fn distribution(&self) -> Distribution {
        self.map.distribution
    }

    /// Multiplies the random weights.
    #[must_use]
    #[doc(alias = "gamma")]
    #[doc(alias = "rbf_width")]
    pub fn with_scale(mut self, scale: f64) -> Self {
        self.map.scale = scale;
        self
    }

    /// What the random weights are multiplied by.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.map.scale
    }

    /// Multiplies the weights of each input on top of [`scale`](Self::with_scale): 0 for an input that
    /// is to be ignored. Empty, the default, means 1 for all. With [ramps](Self::with_embedding) those of an
    /// input have its scale, unless there is one for each input and, after these, for each ramp.
    #[must_use]
    pub fn with_input_scales(mut self, input_scales: Vec<f64>) -> Self {
        self.map.input_scales = input_scales;
        self
    }

    /// What the weights of each input are multiplied by; empty for 1.
    #[must_use]
    pub fn input_scales(&self) -> &[f64] {
        &self.map.input_scales
    }

    /// The scale of each of `inputs` inputs. Where the [ramps](Self::with_embedding) of an input have
    /// scales of their own, it is the root of the sum of their squares. Ramps between quantiles that are
    /// not measured yet do not count.
    ///
    /// ```
    /// use elm::ElmParams;
    ///
    /// let params = ElmParams::<f64>::new(10);
    /// assert_eq!(params.relevance(3), [1.0, 1.0, 1.0]);
    /// assert_eq!(params.with_input_scales(vec![2.0, 0.5]).relevance(2), [2.0, 0.5]);
    /// ```
    #[must_use]
    #[doc(alias = "feature_importances_")]
    pub fn relevance(&self, inputs: usize) -> Vec<f64> {
        let scales = self.input_scales();
        match self.embedding() {
            _ if scales.is_empty() => vec![1.0; inputs],
            Embedding::Ramps(ramps) if scales.len() > inputs => {
                let mut squares = vec![0.0; inputs];
                for (source, scale) in ramps.sources().zip(scales) {
                    if let Some(square) = squares.get_mut(source) {
                        *square += scale * scale;
                    }
                }
                squares.into_iter().map(f64::sqrt).collect()
            }
            _ => scales.iter().copied().take(inputs).collect(),
        }
    }

    /// Seeds the random layer. One seed gives one layer, on every platform. 0 unless set.
    #[must_use]
    #[doc(alias = "random_state")]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.map.seed = seed;
        self
    }

    /// The seed of the random layer.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.map.seed
    }

    /// How the output weights are found: [`Inverse`](crate::solve::Inverse),
    /// [`PseudoInverse`](crate::solve::PseudoInverse) or [`Ridge`](crate::solve::Ridge).
    #[must_use]
    #[doc(alias = "alpha")]
    #[doc(alias = "regressor")]
    pub fn with_solver(mut self, solver: impl Into<Solver>) -> Self {
        self.solver = solver.into();
        self
    }

    /// How the output weights are found.
    #[must_use]
    pub fn solver(&self) -> Solver {
        self.solver
    }

    /// Whether each output has a constant that is not penalized.
    #[must_use]
    #[doc(alias = "fit_intercept")]
    pub fn with_intercept(mut self, intercept: bool) -> Self {
        self.intercept = Some(intercept);
        self
    }

    /// Whether each output has a constant that is not penalized; unless that is set, with every solver
    /// but [`Inverse`](crate::solve::Inverse).
    #[must_use]
    pub fn intercept(&self) -> bool {
        // Equation 10 has no room for a constant; asking for both explicitly is an error later.
        let inverse = matches!(self.solver, Solver::Inverse(_));
        self.intercept.unwrap_or(!inverse)
    }

    /// Whether inputs are brought to mean 0 and standard deviation 1 first.
    #[must_use]
    #[doc(alias = "StandardScaler")]
    pub fn with_standardize(mut self, standardize: bool) -> Self {
        self.map.standardize = standardize;
        self
    }

    /// Whether inputs are brought to mean 0 and standard deviation 1 first.
    #[must_use]
    pub fn standardize(&self) -> bool {
        self.map.standardize
    }

    /// Whether the (standardized) inputs stand beside the hidden neurons in the linear solve: a
    /// random vector functional link network (Pao, Park and Sobajic, 1994).
    #[must_use]
    #[doc(alias = "RVFL")]
    pub fn with_direct_links(mut self, direct_links: bool) -> Self {
        self.map.direct_links = direct_links;
        self
    }

    /// Whether the inputs stand beside the hidden neurons in the linear solve.
    #[must_use]
    pub fn direct_links(&self) -> bool {
        self.map.direct_links
    }

    /// Whether inputs beyond those of the training rows are held at the edge of their range, and
    /// predictions within the range of the training targets and a margin; see
    /// [`bounds`](crate::bounds). Off, a prediction outside the data is whatever the sum of the
    /// neurons comes to there.
    #[must_use]
    pub fn with_bounded(mut self, bounded: bool) -> Self {
        self.bounded = bounded;
        self
    }

    /// Whether predictions outside the training rows are held to their [bounds](crate::bounds).
    #[must_use]
    pub fn bounded(&self) -> bool {
        self.bounded
    }

    /// What the neurons, and direct links, see of the inputs: [`Embedding::Quantiles`] gives them ramps
    /// between quantiles of the training rows beside each input, [`Embedding::Ramps`] given ones.
    ///
    /// ```
    /// use elm::{ElmParams, Embedding};
    /// use ndarray::{Array1, Axis};
    ///
    /// let x = Array1::linspace(0.1, 3.0, 200).mapv(|x: f64| x.powi(6)).insert_axis(Axis(1));
    /// let t = x.column(0).mapv(|x| x.ln());
    /// let model = ElmParams::new(30).with_embedding(Embedding::Quantiles(16)).fit(&x, &t)?;
    /// assert_eq!((model.inputs(), model.hidden().inputs()), (1, 17));
    /// # Ok::<(), elm::Error>(())
    /// ```
    #[must_use]
    pub fn with_embedding(mut self, embedding: Embedding<A>) -> Self {
        self.map.embedding = embedding;
        self
    }

    /// What the neurons see of the inputs.
    #[must_use]
    pub fn embedding(&self) -> &Embedding<A> {
        &self.map.embedding
    }

    /// Checks the settings. Every fit does so first.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) naming the first setting that is out of range.
    pub fn check(&self) -> Result<()> {
        self.map.check()?;
        self.solver.check()
    }
}
