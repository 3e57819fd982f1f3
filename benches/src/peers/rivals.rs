//! The libraries that are compared, and the two that run in this process: this project and the
//! crate elm.

use std::fs;
use std::path::Path;
use std::str::FromStr;

use elm::solve::Ridge;
use elm::{Activation, Elm, ElmParams, Scalar};
use elm_crate::activation_functions::ActivationFunction;
use elm_crate::{ELM, Epsilon};
use ndarray::{Array2, Axis};

use super::data::{Problem, Size};

/// What a user could pick instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rival {
    /// `numpy.linalg.lstsq` on random features.
    NumpyLstsq,
    /// Ridge by `scipy.linalg.cho_factor` on random features.
    ScipyCholesky,
    /// scikit-learn's `Ridge` on random features.
    SklearnRidge,
    /// The Python package hpelm.
    Hpelm,
    /// The crate elm 0.3.2.
    CrateElm,
    /// scikit-learn's `KernelRidge`.
    KernelRidge,
    /// scikit-learn's `MLPRegressor`.
    Mlp,
    /// scikit-learn's `HistGradientBoostingRegressor`.
    HistGradientBoosting,
}

impl Rival {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::NumpyLstsq,
        Self::ScipyCholesky,
        Self::SklearnRidge,
        Self::Hpelm,
        Self::CrateElm,
        Self::KernelRidge,
        Self::Mlp,
        Self::HistGradientBoosting,
    ];

    /// The name in tables and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NumpyLstsq => "numpy lstsq",
            Self::ScipyCholesky => "scipy cholesky",
            Self::SklearnRidge => "sklearn ridge",
            Self::Hpelm => "hpelm",
            Self::CrateElm => "crate elm 0.3.2",
            Self::KernelRidge => "sklearn KernelRidge",
            Self::Mlp => "sklearn MLPRegressor",
            Self::HistGradientBoosting => "sklearn HistGradientBoosting",
        }
    }

    /// Whether it is a random layer with a linear solve, and has a number of neurons.
    #[must_use]
    pub fn is_elm(self) -> bool {
        !matches!(
            self,
            Self::KernelRidge | Self::Mlp | Self::HistGradientBoosting
        )
    }

    /// Whether it has a strength of regularisation.
    pub(super) fn is_regularized(self) -> bool {
        matches!(self, Self::ScipyCholesky | Self::SklearnRidge | Self::Hpelm)
    }

    /// Whether a fit of this size ends within minutes and gigabytes: a kernel matrix has rows
    /// times rows entries.
    pub(super) fn can_fit(self, size: Size) -> bool {
        self != Self::KernelRidge || size.rows <= 5000
    }
}

impl FromStr for Rival {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|rival| rival.name() == text)
            .ok_or_else(|| {
                let names = Self::ALL.map(Self::name).join(", ");
                format!("no peer '{text}'; there are {names}")
            })
    }
}

/// A rival with its settings, of which each uses those that it has.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    pub(super) rival: Rival,
    pub(super) neurons: usize,
    /// Whether the random layer is that of our network, where the rival can be given one; or the
    /// rival draws it.
    pub(super) our_layer: bool,
    /// The regularisation, absolute.
    pub(super) alpha: f64,
    pub(super) seed: u64,
}

/// This project's network with its settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ours {
    pub(super) neurons: usize,
    pub(super) scale: f64,
    /// Relative, as everywhere in this project.
    pub(super) lambda: f64,
    pub(super) seed: u64,
}

impl Ours {
    pub(super) fn fit<A: Scalar>(&self, x: &Array2<A>, t: &Array2<A>) -> Result<Elm<A>, String> {
        ElmParams::new(self.neurons)
            .with_activation(Activation::Tanh)
            .with_scale(self.scale)
            .with_seed(self.seed)
            .with_solver(Ridge::relative(self.lambda))
            .fit(x, t)
            .map_err(|error| error.to_string())
    }

    /// The fit and its test error.
    pub(super) fn score(&self, problem: &Problem) -> Result<(Elm<f64>, f64), String> {
        let model = self.fit(&problem.x, &problem.t)?;
        let y = model.predict(&problem.test_x);
        let error = rmse(&y.map_err(|error| error.to_string())?, &problem.test_t);
        Ok((model, error))
    }
}

pub(super) fn rmse(y: &Array2<f64>, t: &Array2<f64>) -> f64 {
    let squares: f64 = y.iter().zip(t).map(|(y, t)| (y - t).powi(2)).sum();
    (squares / t.len().max(1) as f64).sqrt()
}

/// The crate elm with the data in the form that it takes. It does not standardise, so it is given
/// inputs that are.
pub(super) struct CrateElm {
    x: Vec<Vec<f64>>,
    t: Vec<Vec<f64>>,
    test_x: Vec<Vec<f64>>,
    test_t: Array2<f64>,
}

impl CrateElm {
    pub(super) fn new(problem: &Problem) -> Self {
        let mean = problem.x.mean_axis(Axis(0)).unwrap_or_default();
        let deviation = problem.x.std_axis(Axis(0), 0.0);
        let scaled = |x: &Array2<f64>| lists(&((x - &mean) / &deviation));
        Self {
            x: scaled(&problem.x),
            t: lists(&problem.t),
            test_x: scaled(&problem.test_x),
            test_t: problem.test_t.clone(),
        }
    }

    pub(super) fn fit(&self, neurons: usize) -> ELM {
        let (inputs, outputs) = (self.x[0].len(), self.t[0].len());
        let tanh = ActivationFunction::TanH;
        let mut model = ELM::new(inputs, neurons, outputs, tanh, Epsilon::Default);
        model.train(&self.x, &self.t);
        model
    }

    pub(super) fn error(&self, model: &ELM) -> f64 {
        let y = model.predict(&self.test_x);
        let flat: Vec<f64> = y.into_iter().flatten().collect();
        Array2::from_shape_vec(self.test_t.dim(), flat).map_or(f64::NAN, |y| rmse(&y, &self.test_t))
    }

    pub(super) fn predict(&self, model: &ELM, rows: usize) -> usize {
        let rows = rows.min(self.test_x.len());
        model.predict(&self.test_x[..rows].to_vec()).len()
    }
}

fn lists(matrix: &Array2<f64>) -> Vec<Vec<f64>> {
    matrix.rows().into_iter().map(|row| row.to_vec()).collect()
}

/// Fits once in a process of its own and gives the bytes that this needed at its peak; `None` where
/// the system does not say. `neurons`, `scale` and `lambda` are ours.
///
/// # Errors
/// Those of the fit, as text.
pub fn fit_once(
    size: Size,
    of_crate: bool,
    scale: f64,
    lambda: f64,
) -> Result<Option<u64>, String> {
    let problem = Problem::new(size);
    let lists = of_crate.then(|| CrateElm::new(&problem));
    let ours = Ours {
        neurons: size.neurons,
        scale,
        lambda,
        seed: 1,
    };
    // What making the data has used at its peak does not count.
    let _ = fs::write("/proc/self/clear_refs", "5");
    let before = resident("VmRSS");
    match &lists {
        Some(lists) => drop(std::hint::black_box(lists.fit(size.neurons))),
        None => drop(std::hint::black_box(ours.fit(&problem.x, &problem.t)?)),
    }
    let after = resident("VmHWM");
    Ok(before
        .zip(after)
        .map(|(before, after)| after.saturating_sub(before)))
}

/// A line of `/proc/self/status`, in bytes.
fn resident(key: &str) -> Option<u64> {
    let status = fs::read_to_string(Path::new("/proc/self/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1024 * kibibytes)
}
