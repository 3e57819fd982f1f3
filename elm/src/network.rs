//! The fitted network: a feature map and its output weights.

use std::marker::PhantomData;

use ndarray::{Array1, Array2, ArrayRef2, ArrayView1, ArrayView2, Axis, Ix2};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::bounds::Bounds;
use crate::check::{check_length, check_matrix};
use crate::dataset::{Inputs, TargetDim, check_outputs};
use crate::error::{Error, Result};
use crate::feature_map::{FeatureMap, HiddenLayer, Scaler};
use crate::memory::check_room;
use crate::metrics::root_mean_squares;
use crate::scalar::Scalar;
use crate::solve::norms::norm;
use crate::solve::{Diagnosis, Reason, Solution};

/// A fitted network: $o(x) = \sum_k \beta_k f(\omega_k \cdot x + b_k)$ (equation 7) plus, where
/// set, an intercept and direct links. Made by [`ElmParams::fit`](crate::ElmParams::fit).
///
/// `D` is the dimension of the targets and so of the predictions: `Elm<f64, Ix1>` predicts one value per
/// row, `Elm<f64>` a matrix. A file can be loaded as either, several outputs only as the latter.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::array;
///
/// let (x, t) = (array![[0.0], [1.0], [2.0], [3.0]], array![0.0, 1.0, 4.0, 9.0]);
/// let model = ElmParams::new(10).fit(&x, &t)?;
/// // A prediction is the hidden-layer matrix times the output weights, plus the intercept.
/// let by_hand = model.hidden_matrix(&x)?.dot(&model.beta()) + &model.intercept();
/// assert!((model.predict(&x)? - by_hand.column(0)).iter().all(|d: &f64| d.abs() < 1e-9));
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", try_from = "Parts<A>"))]
pub struct Elm<A: Scalar, D: TargetDim = Ix2> {
    map: FeatureMap<A>,
    /// Shape (features, outputs).
    beta: Array2<A>,
    intercept: Array1<A>,
    diagnosis: Diagnosis,
    /// Of the training rows; nothing for a network of given parts.
    bounds: Option<Bounds<A>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    dimension: PhantomData<D>,
}

/// An [`Elm`] as it comes from outside, before its parts are known to fit together.
#[cfg_attr(feature = "serde", derive(Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Parts<A: Scalar> {
    map: FeatureMap<A>,
    beta: Array2<A>,
    intercept: Array1<A>,
    diagnosis: Diagnosis,
    bounds: Option<Bounds<A>>,
}

impl<A: Scalar, D: TargetDim> Elm<A, D> {
    /// A network of a given feature map and output weights from elsewhere.
    ///
    /// `beta` has shape (features, outputs) and `intercept` one entry per output.
    ///
    /// ```
    /// use elm::{Elm, ElmParams};
    /// use ndarray::{Ix1, array};
    ///
    /// let (x, t) = (array![[0.0], [1.0], [2.0], [3.0]], array![0.0, 1.0, 4.0, 9.0]);
    /// let params = ElmParams::new(10).with_seed(7);
    /// let fitted = params.fit(&x, &t)?;
    /// let again: Elm<f64, Ix1> = Elm::from_parts(
    ///     params.feature_map().draw_on(&x)?,
    ///     fitted.beta().to_owned(),
    ///     fitted.intercept().to_owned(),
    /// )?;
    /// assert_eq!(again.predict(&x)?, fitted.predict(&x)?);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Empty`] and [`Error::NotFinite`] for parts that do not fit.
    pub fn from_parts(map: FeatureMap<A>, beta: Array2<A>, intercept: Array1<A>) -> Result<Self> {
        let diagnosis = Diagnosis::of_given(beta.view());
        Self::try_from(Parts {
            map,
            beta,
            intercept,
            diagnosis,
            bounds: None,
        })
    }
}

impl<A: Scalar, D: TargetDim> TryFrom<Parts<A>> for Elm<A, D> {
    type Error = Error;

    fn try_from(parts: Parts<A>) -> Result<Self> {
        let Parts {
            map,
            beta,
            intercept,
            mut diagnosis,
            bounds,
        } = parts;
        check_outputs::<D>(beta.ncols())?;
        check_matrix("output weights", beta.view())?;
        check_length("rows of output weights", beta.nrows(), map.features())?;
        check_length("intercepts", intercept.len(), beta.ncols())?;
        check_matrix("intercepts", intercept.view().insert_axis(Axis(0)))?;
        diagnosis.check(beta.ncols())?;
        if let Some(bounds) = &bounds {
            bounds.check(map.inputs(), beta.ncols())?;
        }
        Ok(Self {
            map,
            beta,
            intercept,
            diagnosis,
            bounds,
            dimension: PhantomData,
        })
    }
}

impl<A: Scalar, D: TargetDim> Elm<A, D> {
    pub(crate) fn assemble(
        map: FeatureMap<A>,
        solution: Solution<A>,
        bounds: Option<Bounds<A>>,
    ) -> Self {
        let Solution {
            beta,
            intercept,
            diagnosis,
        } = solution;
        Self {
            map,
            beta,
            intercept,
            diagnosis,
            bounds,
            dimension: PhantomData,
        }
    }

    /// The network whose predictions are the mean of those of `members`, which were fitted to the
    /// same rows with the same settings but for their seeds. What its diagnosis has to say of
    /// residuals [`set_errors`](Self::set_errors) fills in; of one member it is that one.
    pub(crate) fn mean(members: &[&Self]) -> Self {
        let first = members[0];
        if members.len() == 1 {
            return first.clone();
        }
        let count = members.len() as f64;
        let share = A::from_f64(count).recip();
        let layers: Vec<_> = members.iter().map(|member| member.hidden()).collect();
        let (hidden, order) = HiddenLayer::join(&layers);
        let neurons = order.len();
        let links = first.beta.nrows() - first.hidden().neurons();
        let mut beta = Array2::zeros((neurons + links, first.outputs()));
        for (mut row, &(member, neuron)) in beta.rows_mut().into_iter().zip(&order) {
            row.assign(&members[member].beta.row(neuron).mapv(|b| b * share));
        }
        let mut intercept = Array1::zeros(first.outputs());
        for member in members {
            intercept.scaled_add(share, &member.intercept);
            let own = member
                .beta
                .slice(ndarray::s![member.hidden().neurons().., ..]);
            beta.slice_mut(ndarray::s![neurons.., ..])
                .scaled_add(share, &own);
        }
        let mean = |of: fn(&Diagnosis) -> &Vec<f64>| -> Vec<f64> {
            let sum =
                |output: usize| -> f64 { members.iter().map(|m| of(&m.diagnosis)[output]).sum() };
            (0..first.outputs()).map(|o| sum(o) / count).collect()
        };
        // The geometric mean: strengths differ by powers of ten.
        let lambda = |output: usize| {
            let logs = members.iter().map(|m| m.diagnosis.lambda[output].ln());
            (logs.sum::<f64>() / count).exp()
        };
        let diagnosis = Diagnosis {
            reason: Reason::Mean,
            rank: None,
            condition: None,
            smallest_singular_value: None,
            lambda: (0..first.outputs()).map(lambda).collect(),
            degrees_of_freedom: mean(|d| &d.degrees_of_freedom),
            beta_norm: beta.columns().into_iter().map(norm).collect(),
            ..first.diagnosis.clone()
        };
        Self {
            map: first.map.with_layer(hidden),
            beta,
            intercept,
            diagnosis,
            bounds: first.bounds.clone(),
            dimension: PhantomData,
        }
    }

    /// The same network with predictions of another dimension: [`Ix2`](type@Ix2) for a matrix,
    /// [`Ix1`](type@ndarray::Ix1) for one value per row.
    ///
    /// ```
    /// use elm::ElmParams;
    /// use ndarray::{Ix2, array};
    ///
    /// let (x, t) = (array![[0.0], [1.0], [2.0], [3.0]], array![0.0, 1.0, 4.0, 9.0]);
    /// let model = ElmParams::new(10).fit(&x, &t)?;
    /// assert_eq!(model.predict(&x)?.shape(), [4]);
    /// assert_eq!(model.into_dimensionality::<Ix2>()?.predict(&x)?.shape(), [4, 1]);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Shape`] for a network of several outputs that is to predict one.
    pub fn into_dimensionality<E: TargetDim>(self) -> Result<Elm<A, E>> {
        check_outputs::<E>(self.outputs())?;
        Ok(Elm {
            map: self.map,
            beta: self.beta,
            intercept: self.intercept,
            diagnosis: self.diagnosis,
            bounds: self.bounds,
            dimension: PhantomData,
        })
    }

    /// Records residuals and leave-one-out residuals, shape (rows, outputs), in the diagnosis.
    pub(crate) fn set_errors(&mut self, residuals: ArrayView2<'_, A>, left_out: ArrayView2<'_, A>) {
        self.diagnosis.residual_norm = residuals.columns().into_iter().map(norm).collect();
        self.diagnosis.leave_one_out = Some(root_mean_squares(left_out).to_vec());
    }

    /// The hidden-layer matrix of these inputs (the paper's $F$, equation 9): shape (rows, inputs)
    /// to (rows, neurons), followed by what the neurons see of the inputs (these standardized, and their
    /// ramps) where that is linked directly. Inputs have been held to their [`bounds`](Self::bounds).
    /// Times [`beta`](Self::beta) plus [`intercept`](Self::intercept) it is the prediction, before that
    /// is held to its own.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Empty`] and [`Error::NotFinite`] for `x`; [`Error::TooLarge`].
    pub fn hidden_matrix<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array2<A>> {
        let x = x.as_matrix();
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        check_matrix("inputs", x)?;
        check_room("the hidden-layer matrix", x.nrows(), self.beta.nrows())?;
        Ok(self.map.apply(self.held_inputs(&x).view()))
    }

    /// Inputs held to their bounds.
    fn held_inputs(&self, x: &ArrayRef2<A>) -> Array2<A> {
        let mut x = x.to_owned();
        if let Some(bounds) = &self.bounds {
            bounds.hold_inputs(&mut x);
        }
        x
    }

    /// The slope of each output at each row along each input, as the network makes its inputs
    /// (standardized, where that is on): one matrix (rows, inputs) for each output.
    pub(crate) fn gradients(&self, x: &ArrayRef2<A>) -> impl Iterator<Item = Array2<A>> {
        let x = self.held_inputs(x);
        let columns = self.beta.columns().into_iter();
        columns.map(move |beta| self.map.gradient(x.view(), beta))
    }

    /// The ranges of the training rows that predictions are held to; nothing for a network
    /// [of given parts](Self::from_parts).
    #[must_use]
    pub fn bounds(&self) -> Option<&Bounds<A>> {
        self.bounds.as_ref()
    }

    /// Whether predictions are held to the [`bounds`](Self::bounds) of the training rows, where
    /// those are known: what [`ElmParams::with_bounded`](crate::ElmParams::with_bounded) says when fitting.
    #[must_use]
    pub fn with_bounded(mut self, bounded: bool) -> Self {
        if let Some(bounds) = &mut self.bounds {
            bounds.hold(bounded);
        }
        self
    }

    /// Whether predictions are held to the [`bounds`](Self::bounds) of the training rows.
    #[must_use]
    pub fn bounded(&self) -> bool {
        self.bounds.as_ref().is_some_and(Bounds::are_held)
    }

    /// How far each row, shape (rows, inputs), lies outside the box that the training rows span: 0
    /// inside, else the Euclidean distance, each input in units of its standard deviation among
    /// the training rows (in its own units where inputs are not standardized). An input that was
    /// constant is ignored, as it is in predictions.
    ///
    /// ```
    /// use elm::ElmParams;
    /// use ndarray::{Array1, Axis, array};
    ///
    /// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
    /// let model = ElmParams::new(20).fit(&x, &x.mapv(f64::sin))?;
    /// let outside = model.distance_outside(&array![[1.0], [6.0]])?;
    /// assert!(outside[0] == 0.0 && (outside[1] - 1.7_f64).abs() < 0.1);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Shape`] and [`Error::NotFinite`] for `x`; [`Error::Conflict`] for a network
    /// [of given parts](Self::from_parts), which knows no training rows.
    pub fn distance_outside<X: Inputs<A> + ?Sized>(&self, x: &X) -> Result<Array1<A>> {
        let x = x.as_matrix();
        let Some(bounds) = &self.bounds else {
            return Err(Error::Conflict {
                first: "a network of given parts",
                second: "a distance from its training rows",
            });
        };
        check_length("columns of inputs", x.ncols(), self.inputs())?;
        if x.nrows() > 0 {
            check_matrix("inputs", x)?;
        }
        Ok(bounds.distance(&x, self.scaler()))
    }

    /// Number of inputs.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.map.inputs()
    }

    /// Number of outputs.
    #[must_use]
    #[doc(alias = "n_outputs_")]
    pub fn outputs(&self) -> usize {
        self.beta.ncols()
    }

    /// The random feature map.
    #[must_use]
    pub fn map(&self) -> &FeatureMap<A> {
        &self.map
    }

    /// The random hidden layer of the [map](Self::map).
    #[must_use]
    pub fn hidden(&self) -> &HiddenLayer<A> {
        self.map.layer()
    }

    /// The standardization of inputs, where it is on.
    #[must_use]
    pub fn scaler(&self) -> Option<&Scaler<A>> {
        self.map.scaler()
    }

    /// The output weights $\beta$, shape (neurons, outputs); with direct links the inputs' rows
    /// follow the neurons'.
    #[must_use]
    #[doc(alias = "coef_")]
    pub fn beta(&self) -> ArrayView2<'_, A> {
        self.beta.view()
    }

    /// The constant added to each output.
    #[must_use]
    #[doc(alias = "intercept_")]
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
