//! From settings to a fitted network: [`ElmParams`] to [`CheckedParams`] to [`Elm`].

use ndarray::{Array2, ArrayBase, ArrayRef2, ArrayView1, ArrayView2, Axis, Data, Ix1, Ix2};
use serde::{Deserialize, Serialize};

use crate::activation::Activation;
use crate::error::{Error, Result};
use crate::hidden::{Biases, Distribution, HiddenLayer, Kind, Neurons, Plan};
use crate::network::{Elm, design};
use crate::predictor::LayerRows;
use crate::scalar::Scalar;
use crate::scaler::Scaler;
use crate::solve::moments::{HiddenRows, RowSource};
use crate::solve::{
    LeastSquares, Solver, check_length, check_matrix, check_room, check_some_weight,
};
use crate::validate::{FoldFit, HeldOut, Validator};

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
    /// The neurons that the setters here describe.
    neurons: Neurons<A>,
    /// Those of other kinds.
    others: Vec<Neurons<A>>,
    distribution: Distribution,
    scale: f64,
    input_scales: Vec<f64>,
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
            neurons: Neurons::new(neurons, Activation::default()),
            others: Vec::new(),
            distribution: Distribution::default(),
            scale: 1.0,
            input_scales: Vec::new(),
            seed: 0,
            solver: Solver::default(),
            intercept: None,
            standardise: true,
            direct_links: false,
        }
    }

    /// Another number of hidden neurons in all. Where there are several kinds, each keeps its share
    /// of them, to within one.
    #[must_use]
    pub fn with_neurons(mut self, neurons: usize) -> Self {
        let before = self.neurons();
        let (mut counted, mut given) = (0.0, 0);
        for group in self.groups_mut() {
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

    fn groups(&self) -> impl Iterator<Item = &Neurons<A>> {
        std::iter::once(&self.neurons).chain(&self.others)
    }

    fn groups_mut(&mut self) -> impl Iterator<Item = &mut Neurons<A>> {
        std::iter::once(&mut self.neurons).chain(&mut self.others)
    }

    /// Number of neurons, of all kinds together.
    #[must_use]
    pub fn neurons(&self) -> usize {
        let add = |sum: usize, group: &Neurons<A>| sum.saturating_add(group.count);
        self.groups().fold(0, add)
    }

    pub(crate) fn get_seed(&self) -> u64 {
        self.seed
    }

    /// The activation function of the hidden neurons.
    #[must_use]
    pub fn activation(mut self, activation: Activation<A>) -> Self {
        self.neurons.activation = activation;
        self
    }

    /// What the activation function is applied to.
    #[must_use]
    pub fn kind(mut self, kind: Kind) -> Self {
        self.neurons.kind = kind;
        self
    }

    /// Adds neurons of another kind to the layer. Everything but what [`Neurons`] sets they have in
    /// common with the others: the distribution, the [`scale`](Self::scale), which theirs multiplies,
    /// the [`input_scales`](Self::input_scales) and the seed.
    #[must_use]
    pub fn and(mut self, neurons: Neurons<A>) -> Self {
        self.others.push(neurons);
        self
    }

    /// The distribution of hidden weights and biases.
    #[must_use]
    pub fn distribution(mut self, distribution: Distribution) -> Self {
        self.distribution = distribution;
        self
    }

    /// Multiplies the random weights.
    #[must_use]
    pub fn scale(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    /// Multiplies the weights of each input on top of [`scale`](Self::scale): 0 for an input that
    /// is to be ignored. Empty, the default, means 1 for all.
    #[must_use]
    pub fn input_scales(mut self, input_scales: Vec<f64>) -> Self {
        self.input_scales = input_scales;
        self
    }

    /// Where the random biases come from.
    #[must_use]
    pub fn biases(mut self, biases: Biases) -> Self {
        self.neurons.biases = biases;
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
        if self.neurons() == 0 {
            return parameter("neurons", 0.0, "at least 1");
        }
        // Written so that NaN fails too.
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return parameter("scale", self.scale, "positive and finite");
        }
        let not_negative = |value: f64| value >= 0.0 && value.is_finite();
        if let Some(&value) = self
            .input_scales
            .iter()
            .find(|value| !not_negative(**value))
        {
            return parameter("input_scales", value, "finite and not negative");
        }
        for group in self.groups() {
            if !(group.scale > 0.0 && group.scale.is_finite()) {
                return parameter("scale of neurons", group.scale, "positive and finite");
            }
            if let Biases::Scaled(value) = group.biases
                && !not_negative(value)
            {
                return parameter("biases", value, "finite and not negative");
            }
        }
        self.solver.check()?;
        Ok(CheckedParams(self))
    }

    fn plan(&self) -> Plan<A> {
        Plan {
            groups: self.groups().cloned().collect(),
            distribution: self.distribution,
            scale: self.scale,
            input_scales: self.input_scales.clone(),
            seed: self.seed,
        }
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
///
/// ```
/// use elm::{ElmParams, Error, validate::assign_folds};
/// use ndarray::{Array1, Axis};
///
/// let refused = ElmParams::<f64>::new(0).check();
/// assert!(matches!(refused, Err(Error::Parameter { name: "neurons", .. })));
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.mapv(f64::sin);
/// let params = ElmParams::new(20).check()?;
/// let folds = assign_folds(60, 10, 1)?;
/// let held_out = params.cross_validate(&x, &t, &folds)?;
/// assert!(held_out.rmse()[0] < 1e-2);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedParams<A: Scalar>(ElmParams<A>);

impl<A: Scalar> CheckedParams<A> {
    /// Draws the hidden layer and solves for the output weights.
    ///
    /// `x` has shape (rows, inputs); `t` has shape (rows, outputs), or (rows) for one output.
    ///
    /// # Errors
    /// [`Error::Empty`], [`Error::Shape`] and [`Error::NotFinite`] for the data,
    /// [`Error::TooLarge`] for more neurons than memory holds, and those of [`Solver::solve`].
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
        let t = t.as_matrix();
        let (scaler, hidden) = self.prepare(x.view(), t)?;
        if let Some(weights) = &weights {
            check_some_weight(weights.view(), x.nrows())?;
        }
        let links = self.0.direct_links;
        let layer = LayerRows::new(&hidden, scaler.as_ref(), links, x.view());
        let mut source = RowSource {
            hidden: HiddenRows::Layer(Box::new(layer)),
            targets: t,
            weights,
            intercept: self.has_intercept(),
        };
        let solution = match self.0.solver.solve_rows(&mut source)? {
            Some(solution) => solution,
            None => {
                let design = self.design(x.view(), scaler.as_ref(), &hidden)?;
                let problem = self.problem(&design, t, weights.as_ref())?;
                self.0.solver.solve(&problem)?
            }
        };
        Ok(Elm::assemble(scaler, hidden, links, solution))
    }

    /// The random layer alone, for this many inputs: what a [`fit`](Self::fit) draws. Whoever keeps
    /// these settings need keep no weights of it; see [`Elm::from_parts`].
    ///
    /// # Errors
    /// [`Error::Empty`] without inputs, [`Error::Shape`] for another number of input scales,
    /// [`Error::TooLarge`]; [`Error::Conflict`] for neurons that are laid on training rows
    /// ([`Biases::OnData`], [`Kind::Radial`]), as there are none.
    pub fn hidden_layer(&self, inputs: usize) -> Result<HiddenLayer<A>> {
        if self.needs_rows() {
            return Err(Error::Conflict {
                first: "neurons laid on training rows",
                second: "a layer without them",
            });
        }
        let nowhere = Array2::zeros((1, inputs));
        check_matrix("inputs", nowhere.view())?;
        self.layer(nowhere.view())
    }

    /// Held-out predictions for every row, from one random layer and one factorisation: `folds`
    /// has one label per row, and rows of one label are predicted by the fit to all others.
    ///
    /// Ridge has the same strength in every fold, given or chosen on all rows, and inputs are
    /// standardised on all rows; [`validate`](crate::validate) says what that leaks.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit) for the data and of [`Validator::k_fold`];
    /// [`Error::Conflict`] for [`Inverse`](crate::solve::Inverse), which cannot be fitted to fewer
    /// rows, and for a pseudo-inverse with a cut-off of its own, which would fall elsewhere in
    /// every fold.
    pub fn cross_validate<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        folds: &[usize],
    ) -> Result<HeldOut<A>> {
        let (validator, lambda) = self.in_closed_form(x.view(), t.as_matrix())?;
        validator.k_fold(folds, &lambda)
    }

    /// What the fit without each fold predicts for **every** row, those that it was fitted to
    /// among them: as [`cross_validate`](Self::cross_validate), with the fits' training errors
    /// beside the held-out ones. One entry per fold, in rising order of its label.
    ///
    /// # Errors
    /// Those of [`cross_validate`](Self::cross_validate).
    pub fn cross_fits<T: Targets<A>>(
        &self,
        x: &ArrayRef2<A>,
        t: &T,
        folds: &[usize],
    ) -> Result<Vec<FoldFit<A>>> {
        let (validator, lambda) = self.in_closed_form(x.view(), t.as_matrix())?;
        validator.k_fold_fits(folds, &lambda)
    }

    /// The problem, factorised, and the strengths of its solver.
    fn in_closed_form(
        &self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
    ) -> Result<(Validator<A>, Vec<f64>)> {
        let conflict = |first| {
            Err(Error::Conflict {
                first,
                second: "validation in closed form",
            })
        };
        let ridge = match self.0.solver {
            Solver::Inverse(_) => return conflict("the solver 'inverse'"),
            Solver::PseudoInverse(solver) if solver.cutoff().is_some() => {
                return conflict("a cut-off of the pseudo-inverse");
            }
            Solver::PseudoInverse(_) => None,
            Solver::Ridge(ridge) => Some(ridge),
        };
        let validator = self.validator(x, t)?;
        let lambda = match ridge {
            Some(ridge) => validator.strengths(ridge)?,
            None => vec![0.0],
        };
        Ok((validator, lambda))
    }

    /// Draws the layer, applies it, and factorises.
    pub(crate) fn validator(
        &self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
    ) -> Result<Validator<A>> {
        let design = self.draw(x, t)?.design;
        Validator::new(&self.problem(&design, t, None)?)
    }

    /// Checks the data, draws the layer and applies it.
    pub(crate) fn draw(&self, x: ArrayView2<'_, A>, t: ArrayView2<'_, A>) -> Result<Drawn<A>> {
        let (scaler, hidden) = self.prepare(x, t)?;
        let design = self.design(x, scaler.as_ref(), &hidden)?;
        Ok(Drawn {
            scaler,
            hidden,
            design,
        })
    }

    /// Checks the data and draws the layer.
    fn prepare(
        &self,
        x: ArrayView2<'_, A>,
        t: ArrayView2<'_, A>,
    ) -> Result<(Option<Scaler<A>>, HiddenLayer<A>)> {
        check_matrix("inputs", x)?;
        check_matrix("targets", t)?;
        check_length("rows of targets", t.nrows(), x.nrows())?;

        // Asked before anything is drawn, as a failed allocation would abort the program. Where rows
        // outnumber neurons the matrix itself may not be needed.
        let neurons = self.0.neurons();
        check_room("the hidden-layer matrix", x.nrows().min(neurons), neurons)?;
        let scaler = self.0.standardise.then(|| Scaler::measure(x));
        let hidden = match &scaler {
            Some(scaler) if self.needs_rows() => self.layer(scaler.transform(x).view())?,
            _ => self.layer(x)?,
        };
        Ok((scaler, hidden))
    }

    /// The hidden-layer matrix, with the inputs beside it where they are linked directly.
    fn design(
        &self,
        x: ArrayView2<'_, A>,
        scaler: Option<&Scaler<A>>,
        hidden: &HiddenLayer<A>,
    ) -> Result<Array2<A>> {
        check_room("the hidden-layer matrix", x.nrows(), self.0.neurons())?;
        let scaled = scaler.map(|scaler| scaler.transform(x));
        let x = scaled.as_ref().map_or(x, |scaled| scaled.view());
        Ok(design(hidden, self.0.direct_links, x))
    }

    pub(crate) fn problem<'a>(
        &self,
        design: &'a Array2<A>,
        t: ArrayView2<'a, A>,
        weights: Option<&'a ArrayView1<'_, A>>,
    ) -> Result<LeastSquares<'a, A>> {
        let problem = LeastSquares::of_views(design.view(), t)?.intercept(self.has_intercept());
        match weights {
            Some(weights) => problem.weights(weights),
            None => Ok(problem),
        }
    }

    /// The random layer for these (standardised) rows.
    pub(crate) fn layer(&self, x: ArrayView2<'_, A>) -> Result<HiddenLayer<A>> {
        let params = &self.0;
        // A failed allocation would abort the program.
        let per_neuron = x.ncols().saturating_add(1);
        check_room("the hidden layer", per_neuron, params.neurons())?;
        if !params.input_scales.is_empty() {
            check_length("input scales", params.input_scales.len(), x.ncols())?;
        }
        Ok(params.plan().draw(x))
    }

    /// Whether the layer takes more of the rows than the number of their inputs.
    pub(crate) fn needs_rows(&self) -> bool {
        self.0.groups().any(Neurons::need_rows)
    }

    /// Equation 10 has no room for a constant; asking for both explicitly is an error later.
    pub(crate) fn has_intercept(&self) -> bool {
        let inverse = matches!(self.0.solver, Solver::Inverse(_));
        self.0.intercept.unwrap_or(!inverse)
    }

    pub(crate) fn standardises(&self) -> bool {
        self.0.standardise
    }

    pub(crate) fn links_directly(&self) -> bool {
        self.0.direct_links
    }

    pub(crate) fn solver(&self) -> Solver {
        self.0.solver
    }

    /// The settings.
    #[must_use]
    pub fn params(&self) -> &ElmParams<A> {
        &self.0
    }
}

/// A random layer and what it makes of the training inputs.
pub(crate) struct Drawn<A: Scalar> {
    pub(crate) scaler: Option<Scaler<A>>,
    pub(crate) hidden: HiddenLayer<A>,
    pub(crate) design: Array2<A>,
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
