//! Runs every solver on every problem of the stress suite.

use elm::solve::{Diagnosis, Inverse, LeastSquares, PseudoInverse, Ridge, Solution, Solver};
use elm::{Elm, ElmParams, Scalar};
use ndarray::{Array1, Array2, ArrayView2, Axis};
use serde::Serialize;

use super::cases::{Level, Magnitude, Problem};
use super::{Case, oracle, reference};
use crate::timing::median;

/// A way to the output weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Equation 10; on square matrices only.
    Inverse,
    /// Equation 11.
    PseudoInverse,
    /// Ridge with a strength of 1e-6.
    Ridge,
    /// Ridge with its strength by generalised cross-validation.
    Gcv,
    /// What a user gets who sets nothing.
    Auto,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Inverse,
        Self::PseudoInverse,
        Self::Ridge,
        Self::Gcv,
        Self::Auto,
    ];

    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Inverse => "inverse",
            Self::PseudoInverse => "pseudo-inverse",
            Self::Ridge => "ridge-1e-6",
            Self::Gcv => "ridge-gcv",
            Self::Auto => "auto",
        }
    }

    fn solver(self) -> Solver {
        match self {
            Self::Inverse => Inverse.into(),
            Self::PseudoInverse => PseudoInverse::default().into(),
            Self::Ridge => Ridge::relative(1e-6).into(),
            Self::Gcv => Ridge::gcv().into(),
            Self::Auto => Solver::default(),
        }
    }
}

/// A floating-point type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Single.
    F32,
    /// Double.
    F64,
}

/// What to run.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Seeds 1 to this.
    pub seeds: u64,
    /// Which solvers.
    pub methods: Vec<Method>,
    /// Whether the first seed is compared with the double-double reference, which takes most of
    /// the time.
    pub reference: bool,
}

/// One solver on one case, over all seeds. A value that does not exist is `None`, never NaN.
#[derive(Debug, Clone, Serialize)]
pub struct Record {
    /// Name of the case.
    pub case: &'static str,
    /// Name of the solver; `auto` is the default fit.
    pub solver: &'static str,
    /// The linear algebra behind it.
    pub backend: &'static str,
    /// The type it computed in.
    pub precision: Precision,
    /// Test RMSE, median over seeds, in the unit of the noiseless targets.
    pub rmse: Option<f64>,
    /// Test RMSE over the oracle's, median over seeds.
    pub ratio_to_oracle: Option<f64>,
    /// The largest ratio over seeds.
    pub worst_ratio: Option<f64>,
    /// Why a fit failed, at the first seed where one did.
    pub error: Option<String>,
    /// Distance of the test predictions from the double-double reference, relative to the norm of
    /// that; of the first seed.
    pub reference_error: Option<f64>,
    /// Rows and columns of the hidden-layer matrix.
    pub shape: [usize; 2],
    /// What the solver reported at the first seed.
    #[serde(flatten)]
    pub report: Option<Report>,
}

/// The part of a [`Diagnosis`] that a table has room for; of the first output.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Numerical rank, where the route finds it.
    pub rank: Option<usize>,
    /// Condition number, with it.
    pub condition: Option<f64>,
    /// Strength of ridge, relative.
    pub lambda: f64,
    /// Effective degrees of freedom.
    pub degrees_of_freedom: f64,
    /// The way of the factorisation.
    pub route: elm::solve::Route,
}

impl Report {
    fn new(diagnosis: &Diagnosis) -> Self {
        let first = |values: &[f64]| values.first().copied().unwrap_or(0.0);
        Self {
            rank: diagnosis.rank,
            condition: diagnosis.condition,
            lambda: first(&diagnosis.lambda),
            degrees_of_freedom: first(&diagnosis.degrees_of_freedom),
            route: diagnosis.route,
        }
    }
}

/// Runs cases in one precision.
#[must_use]
pub fn run(cases: &[Case], precision: Precision, settings: &Settings) -> Vec<Record> {
    let of_case = |case: &Case| match precision {
        Precision::F32 => records::<f32>(case, precision, settings),
        Precision::F64 => records::<f64>(case, precision, settings),
    };
    cases.iter().flat_map(of_case).collect()
}

fn records<A: Scalar>(case: &Case, precision: Precision, settings: &Settings) -> Vec<Record> {
    let trials: Vec<Vec<Trial>> = (1..=settings.seeds)
        .map(|seed| {
            let compare = settings.reference && seed == 1;
            Task::<A>::new(&case.problem(seed), seed).trials(&settings.methods, compare)
        })
        .collect();
    let of_method = |(index, method): (usize, &Method)| {
        let trials: Vec<&Trial> = trials.iter().filter_map(|t| t.get(index)).collect();
        let first = trials.first()?;
        if *method == Method::Inverse && first.shape[0] != first.shape[1] {
            return None;
        }
        let error = trials.iter().find_map(|t| t.outcome.as_ref().err());
        let values = |f: fn(&Outcome) -> f64| -> Vec<f64> {
            let outcomes = trials.iter().filter_map(|t| t.outcome.as_ref().ok());
            outcomes.map(f).filter(|value| value.is_finite()).collect()
        };
        let (rmse, ratios) = (values(|o| o.rmse), values(|o| o.ratio));
        let defined = error.is_none();
        let outcome = first.outcome.as_ref().ok();
        Some(Record {
            case: case.name,
            solver: method.name(),
            backend: elm::backend(),
            precision,
            rmse: median(rmse).filter(|_| defined),
            worst_ratio: ratios.iter().copied().reduce(f64::max).filter(|_| defined),
            ratio_to_oracle: median(ratios).filter(|_| defined),
            error: error.cloned(),
            reference_error: outcome.and_then(|o| o.reference_error),
            shape: first.shape,
            report: outcome.map(|o| o.report.clone()),
        })
    };
    settings
        .methods
        .iter()
        .enumerate()
        .filter_map(of_method)
        .collect()
}

/// One method at one seed.
struct Trial {
    shape: [usize; 2],
    outcome: Result<Outcome, String>,
}

struct Outcome {
    rmse: f64,
    ratio: f64,
    reference_error: Option<f64>,
    report: Report,
}

/// A problem in the type that is tested, with its oracle.
struct Task<A: Scalar> {
    params: Option<ElmParams<A>>,
    train: Array2<A>,
    targets: Array2<A>,
    test: Array2<A>,
    /// What the targets were multiplied by: a power of two, so that nothing is rounded twice.
    unit: f64,
    /// In units of 1.
    test_targets: Array2<f64>,
}

/// A fit: its predictions for the test rows, and what the solver said.
struct Fit {
    predicted: Array2<f64>,
    diagnosis: Diagnosis,
}

impl<A: Scalar> Task<A> {
    fn new(problem: &Problem, seed: u64) -> Self {
        let unit = unit(problem.magnitude, A::NAME == "f32");
        let typed = |a: &Array2<f64>| a.mapv(A::from_f64);
        let scaled = |a: &Array2<f64>| a.mapv(|v| A::from_f64(v * unit));
        Self {
            params: match problem.level {
                Level::Data { neurons, scale } => {
                    Some(ElmParams::new(neurons).with_scale(scale).with_seed(seed))
                }
                Level::Matrix => None,
            },
            train: typed(&problem.train),
            targets: scaled(&problem.targets),
            test: typed(&problem.test),
            test_targets: in_units(scaled(&problem.test_targets).view(), unit),
            unit,
        }
    }

    fn trials(&self, methods: &[Method], compare: bool) -> Vec<Trial> {
        let auto = self
            .params
            .as_ref()
            .map(|params| params.fit(&self.train, &self.targets));
        let network = match (&self.params, &auto) {
            (Some(_), Some(Ok(network))) => Ok(Some(network.clone())),
            // The layer is the same whatever the solver.
            (Some(params), _) => {
                let other = params.clone().with_solver(Ridge::relative(1.0));
                other.fit(&self.train, &self.targets).map(Some)
            }
            (None, _) => Ok(None),
        };
        let matrices = network.and_then(|network| self.matrices(network.as_ref()));
        let (hidden, test) = match matrices {
            Ok(matrices) => matrices,
            Err(error) => {
                let failed = |_: &Method| Trial {
                    shape: [self.train.nrows(), 0],
                    outcome: Err(error.to_string()),
                };
                return methods.iter().map(failed).collect();
            }
        };
        let shape = [hidden.nrows(), hidden.ncols()];
        let (wide_hidden, wide_test) = (hidden.mapv(A::as_f64), test.mapv(A::as_f64));
        let targets = in_units(self.targets.view(), self.unit);
        let best = oracle::best(
            wide_hidden.view(),
            targets.view(),
            wide_test.view(),
            self.test_targets.view(),
            self.params.is_some(),
        );
        let trial = |&method: &Method| {
            let fit = match (method, &auto) {
                (Method::Auto, Some(network)) => self.predict(network),
                _ => self.solve(method, &hidden, &test),
            };
            let outcome = fit.map_err(|error| error.to_string()).map(|fit| {
                let truth = compare.then(|| {
                    let intercept = self.params.is_some() && method != Method::Inverse;
                    let hidden = wide_hidden.view();
                    let other = reference_of(
                        &fit.diagnosis,
                        hidden,
                        targets.view(),
                        wide_test.view(),
                        intercept,
                    )?;
                    Some(distance(&fit.predicted, &other))
                });
                self.outcome(&fit, best.as_ref(), truth.flatten())
            });
            Trial { shape, outcome }
        };
        methods.iter().map(trial).collect()
    }

    /// The hidden-layer matrices of training and test rows.
    fn matrices(&self, network: Option<&Elm<A>>) -> elm::Result<(Array2<A>, Array2<A>)> {
        Ok(match network {
            Some(network) => (
                network.hidden_matrix(&self.train)?,
                network.hidden_matrix(&self.test)?,
            ),
            None => (self.train.clone(), self.test.clone()),
        })
    }

    fn predict(&self, network: &elm::Result<Elm<A>>) -> elm::Result<Fit> {
        let network = network.as_ref().map_err(Clone::clone)?;
        Ok(Fit {
            predicted: in_units(network.predict(&self.test)?.view(), self.unit),
            diagnosis: network.diagnosis().clone(),
        })
    }

    fn solve(&self, method: Method, hidden: &Array2<A>, test: &Array2<A>) -> elm::Result<Fit> {
        let intercept = self.params.is_some() && method != Method::Inverse;
        let problem = LeastSquares::new(hidden, &self.targets)?.with_intercept(intercept);
        let Solution {
            beta,
            intercept,
            diagnosis,
        } = method.solver().solve(&problem)?;
        let predicted = test.dot(&beta) + intercept;
        Ok(Fit {
            predicted: in_units(predicted.view(), self.unit),
            diagnosis,
        })
    }

    fn outcome(&self, fit: &Fit, best: Option<&Array1<f64>>, truth: Option<f64>) -> Outcome {
        let error = root_mean_square((&fit.predicted - &self.test_targets).view());
        let best = best.map_or(f64::NAN, |best| best.mean().unwrap_or(f64::NAN).sqrt());
        // An error below the type's resolution of the targets is no error.
        let resolution = A::epsilon().as_f64() * root_mean_square(self.test_targets.view());
        Outcome {
            rmse: error * self.unit,
            ratio: error.max(resolution) / best.max(resolution),
            reference_error: truth,
            report: Report::new(&fit.diagnosis),
        }
    }
}

/// Largest amount of work, in fused operations, for which the reference is computed.
const REFERENCE_WORK: usize = 40_000_000;

/// Predictions of the answer that the solver meant to give, in double-double: for ridge always,
/// for the pseudo-inverse where its cut-off dropped nothing, as the cut-off is an answer too.
pub(super) fn reference_of(
    diagnosis: &Diagnosis,
    hidden: ArrayView2<'_, f64>,
    targets: ArrayView2<'_, f64>,
    test: ArrayView2<'_, f64>,
    intercept: bool,
) -> Option<Array2<f64>> {
    let (rows, neurons) = hidden.dim();
    let work = (rows + neurons) * neurons * neurons;
    let plain = diagnosis.lambda.contains(&0.0);
    let determined = diagnosis.rank == Some(neurons) && neurons + usize::from(intercept) <= rows;
    if work > REFERENCE_WORK || (plain && !determined) {
        return None;
    }
    let largest = diagnosis.largest_singular_value;
    let lambda: Vec<f64> = diagnosis
        .lambda
        .iter()
        .map(|l| l * largest * largest)
        .collect();
    reference::predict(hidden, targets, test, &lambda, intercept)
}

/// Distance relative to the second, in the Frobenius norm.
pub(super) fn distance(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    let scale = root_mean_square(b.view());
    let difference = root_mean_square((a - b).view());
    if scale > 0.0 {
        difference / scale
    } else {
        difference
    }
}

fn root_mean_square(a: ArrayView2<'_, f64>) -> f64 {
    let squares = a.mapv(|v| v * v);
    let columns = squares
        .mean_axis(Axis(0))
        .and_then(|columns| columns.mean());
    columns.unwrap_or(f64::NAN).sqrt()
}

fn in_units<A: Scalar>(a: ArrayView2<'_, A>, unit: f64) -> Array2<f64> {
    a.mapv(|v| v.as_f64() / unit)
}

/// A power of two, so that multiplying by it rounds nothing but subnormals.
fn unit(magnitude: Magnitude, single: bool) -> f64 {
    let exponent = match (magnitude, single) {
        (Magnitude::One, _) => 0,
        (Magnitude::Huge, false) => 498,
        (Magnitude::Huge, true) => 60,
        (Magnitude::Subnormal, false) => -1056,
        (Magnitude::Subnormal, true) => -136,
    };
    // Not powi, which may go by way of 2^1056.
    f64::from(exponent).exp2()
}
