//! Pruning: keeps the most useful neurons of a large network.
//!
//! What evaluation costs is its neurons, and of random neurons most are of little use. Drawn in
//! plenty, and all but the most useful struck out, a given number of neurons is far more accurate
//! than that number drawn at random: on smooth functions several times, on noisy ones as far as the
//! noise allows (the example `prune` shows how far). The neurons that are kept are as they were
//! drawn; only their output weights are found again. The result is an ordinary [`Elm`].
//!
//! ```
//! use elm::prune::Keep;
//! use elm::{Activation, Dataset, ElmParams};
//! use ndarray::{Array1, Axis};
//!
//! let x = Array1::linspace(-3.0, 3.0, 200).insert_axis(Axis(1));
//! let t = x.mapv(|x: f64| (2.0 * x).sin() * x);
//! let data = Dataset::new(&x, &t)?;
//! let params = ElmParams::new(80).with_activation(Activation::Tanh);
//! let ten = params.fit_pruned(&data, Keep::Neurons(10))?.model;
//! assert_eq!(ten.hidden().neurons(), 10);
//!
//! // As few as leave-one-out says will do.
//! let pruned = params.fit_pruned(&data, Keep::Loss(0.1))?;
//! println!("{} of 80 neurons", pruned.kept.len());
//! # assert!(pruned.kept.len() < 80);
//! # Ok::<(), elm::Error>(())
//! ```
//!
//! # How
//! Backward elimination under ridge of one strength $\lambda$: the solver's, or where that chooses
//! its own the one that generalized cross-validation chooses for all candidates. With
//! $A = (\tilde H^T \tilde H + \lambda)^{-1}$ striking out neuron $k$ and fitting the others again
//! costs
//! $$\frac{\beta_k^2}{A_{kk}}$$
//! of the penalized sum of squares (of several outputs, the sum of these relative to the outputs'
//! variances), exactly; the neuron that costs least goes, $A$ and $\beta$ are brought down by one
//! (Hassibi and Stork's optimal brain surgeon, 1993, which for a linear readout is exact), and so
//! on. That gives an order, and each beginning of it is a network. In that order one triangle $R$
//! of $[\tilde H; \sqrt\lambda I]$ serves them all: its rows' coordinates $q_i = R^{-T} \tilde h_i$
//! add up, neuron by neuron, to the fitted value and to the leverage of row $i$, so that one pass
//! over the rows has the exact leave-one-out error of **every** size. The smallest that keeps to the
//! stated loss is taken, and fitted by the parameters' own solver.
//!
//! Everything comes from orthogonal factorizations, never from $\tilde H^T \tilde H$; $A$ is computed
//! anew, from the triangle of what is left, each time a quarter of the neurons has gone, and
//! $\lambda$ is at least 1e-15 of the largest squared singular value for it.
//!
//! # Cost
//! With $n$ rows and $m$ candidates, in multiply-adds: $n m^2$ for the triangle, about $12 m^3$ for
//! $\lambda$ and the elimination, and with [`Keep::Loss`] $n m^2$ for the pass over the rows, with
//! [`Keep::Neurons`] $n$ times the square of what is kept. All in `f64`.
//!
//! # What the leave-one-out error of a pruned network is worth
//! The rows that judge a network have here chosen its neurons, so that its leave-one-out error
//! ([`Pruned::path`], and that in the diagnosis) is too good: the more so, the more candidates there
//! are per row and the noisier the targets. As a bound on the loss it holds for the rows at hand: on
//! Friedman 1, 1000 rows with noise of deviation 1, 400 candidates and a stated loss of 5 %, the error
//! against the function itself rose from 0.74 to 1.11 (example `prune`), which with the noise is 20 %.
//! Judge the result on rows that were held back.

mod fit;

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Ix2, concatenate, s};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::linalg::{Backend, QrFactor};
use crate::network::Elm;
use crate::scalar::Scalar;
use crate::solve::design_svd::DesignSvd;
use crate::solve::equilibration::{EquilibratedProblem, Equilibration};
use crate::solve::lanczos::largest_eigenvalue;
use crate::solve::symmetric::Symmetric;
use crate::solve::{Lambda, LeastSquares, Ridge};

/// How much of a layer stays.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Keep {
    /// Exactly this number of neurons.
    Neurons(usize),
    /// As few neurons as keep the leave-one-out RMSE within 1 plus this times that of all: 0.05 for
    /// a loss of 5 %. Of several outputs, the root mean square of their RMSEs, each relative to the
    /// output's standard deviation.
    Loss(#[cfg_attr(feature = "serde", serde(serialize_with = "crate::numbers::finite"))] f64),
}

/// A size of network, and how good it is by leave-one-out at the strength that ranked the neurons.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Size {
    /// Number of neurons.
    pub neurons: usize,
    /// Leave-one-out RMSE relative to the targets' standard deviation, root mean square over
    /// outputs; infinite where a row determines its own fit.
    #[cfg_attr(feature = "serde", serde(with = "crate::numbers::score"))]
    pub score: f64,
}

/// A pruned network; made by [`ElmParams::fit_pruned`](crate::ElmParams::fit_pruned).
#[derive(Debug, Clone, PartialEq)]
pub struct Pruned<A: Scalar, D: TargetDim = Ix2> {
    /// The network of the neurons that are kept.
    pub model: Elm<A, D>,
    /// Which of the neurons drawn they are, rising.
    pub kept: Vec<usize>,
    /// The sizes that were looked at, the smallest first: from 1 to all for [`Keep::Loss`], the one
    /// asked for for [`Keep::Neurons`].
    pub path: Vec<Size>,
}

impl Keep {
    fn check(self, neurons: usize) -> Result<()> {
        let parameter = |name, value, expected| {
            Err(Error::Parameter {
                name,
                value,
                expected,
            })
        };
        match self {
            Self::Neurons(kept) if kept == 0 || kept > neurons => parameter(
                "neurons kept",
                kept as f64,
                "at least 1 and at most those there are",
            ),
            // Written so that NaN fails too.
            Self::Loss(loss) if !(loss >= 0.0 && loss.is_finite()) => {
                parameter("loss", loss, "finite and not negative")
            }
            _ => Ok(()),
        }
    }
}

/// The weakest ridge, relative to the largest squared singular value, that elimination is done
/// under: below, the inverse would have no digits.
const FLOOR: f64 = 1e-15;

/// The neurons to keep, of the first `neurons` columns, and the sizes looked at.
fn choose(
    problem: &LeastSquares<'_, f64>,
    neurons: usize,
    ridge: Ridge,
    keep: Keep,
) -> Result<(Vec<usize>, Vec<Size>)> {
    let prepared = EquilibratedProblem::new(problem);
    let root = Root::new(&prepared, ridge)?;
    let least = match keep {
        Keep::Neurons(kept) => kept,
        Keep::Loss(_) => 1,
    };
    let columns = prepared.hidden.ncols();
    let mut elimination = Elimination::new(&root, (0..columns).collect())?;
    let mut struck_out = Vec::new();
    while neurons - struck_out.len() > least {
        let Some(place) = elimination.cheapest(neurons) else {
            break;
        };
        struck_out.push(elimination.remove(place));
        if elimination.is_due() {
            elimination = Elimination::new(&root, elimination.columns)?;
        }
    }

    // Links first, which always stay, then the neurons from the last struck out to the first.
    let mut order: Vec<usize> = (neurons..columns).collect();
    order.extend(elimination.columns.iter().filter(|&&c| c < neurons));
    if let Keep::Loss(_) = keep {
        order.extend(struck_out.iter().rev());
    }
    let first = columns - neurons + least;
    let scores = leave_one_out_scores(&prepared, &root, &order, first)?;
    let path: Vec<Size> = (least..)
        .zip(scores)
        .map(|(neurons, score)| Size { neurons, score })
        .collect();
    let kept = match keep {
        Keep::Neurons(kept) => kept,
        Keep::Loss(loss) => smallest_within(&path, loss).unwrap_or(neurons),
    };
    let kept = order.split_off(columns - neurons).into_iter().take(kept);
    Ok((kept.collect(), path))
}

/// The smallest size whose score is within 1 + `loss` times that of all neurons; or, where those
/// determine a row's own fit, times the best.
fn smallest_within(path: &[Size], loss: f64) -> Option<usize> {
    let all = path.last()?.score;
    let reference = if all.is_finite() {
        all
    } else {
        path.iter().fold(f64::INFINITY, |m, size| m.min(size.score))
    };
    let bound = reference * (1.0 + loss);
    let within = |size: &&Size| size.score.is_finite() && size.score <= bound;
    path.iter().find(within).map(|size| size.neurons)
}

/// What elimination needs to know of the rows.
struct Root {
    /// A matrix with the same products of columns as the hidden-layer matrix: its triangle, or
    /// itself where that has no more rows than columns.
    hidden: Array2<f64>,
    /// What goes with it of the targets.
    targets: Array2<f64>,
    /// The ridge.
    lambda: f64,
    /// What each output's squared weights count.
    output_weights: Array1<f64>,
}

impl Root {
    fn new(prepared: &EquilibratedProblem<f64>, ridge: Ridge) -> Result<Self> {
        let EquilibratedProblem {
            hidden,
            targets,
            frame,
        } = prepared;
        let (hidden, targets, residual_ss) = if hidden.nrows() > hidden.ncols() {
            let QrFactor {
                r,
                qtb,
                residual_ss,
            } = f64::triangularize(hidden.view(), targets.view())?;
            (r, qtb, residual_ss)
        } else {
            let none = Array1::zeros(targets.ncols());
            (hidden.clone(), targets.clone(), none)
        };
        let lengths = targets.columns().into_iter().map(|t| t.dot(&t));
        let squares = lengths.collect::<Array1<f64>>() + &residual_ss;
        // The relative strength and what it is relative to; nothing where no column varies.
        let strength = if let Lambda::Relative(relative) = ridge.lambda() {
            let gram = Symmetric::of_lower(&f64::gram(hidden.view()));
            largest_eigenvalue(&gram).map(|largest| (relative, largest))
        } else {
            let triangle = QrFactor {
                r: hidden.clone(),
                qtb: targets.clone(),
                residual_ss,
            };
            let spectrum = DesignSvd::of_triangle(triangle, frame.clone())?;
            let relative = ridge
                .with_shared(true)
                .select_lambda_without_rows(&spectrum);
            let relative = relative.first().copied().unwrap_or(FLOOR);
            spectrum.s.first().map(|s| (relative, s * s))
        };
        // Where no column varies any ridge does.
        let lambda = strength.map_or(1.0, |(relative, largest)| relative.max(FLOOR) * largest);
        let output_weights = squares.mapv_into(reciprocal_or_one);
        Ok(Self {
            hidden,
            targets,
            lambda,
            output_weights,
        })
    }

    /// The triangle of these columns over the root of the ridge, and the targets in it.
    fn triangle(&self, columns: &[usize]) -> Result<QrFactor<f64>> {
        let ridge = Array2::from_diag_elem(columns.len(), self.lambda.sqrt());
        let nothing = Array2::zeros((columns.len(), self.targets.ncols()));
        let hidden = self.hidden.select(Axis(1), columns);
        let stack = |above: ArrayView2<'_, f64>, below: ArrayView2<'_, f64>| {
            concatenate(Axis(0), &[above, below]).map_err(|_| Error::Overflow {
                what: "a matrix over the ridge",
            })
        };
        let hidden = stack(hidden.view(), ridge.view())?;
        let targets = stack(self.targets.view(), nothing.view())?;
        Ok(f64::triangularize(hidden.view(), targets.view())?)
    }
}

fn reciprocal_or_one(squares: f64) -> f64 {
    if squares > 0.0 { squares.recip() } else { 1.0 }
}

/// The inverse of a triangle.
fn inverse(triangle: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
    let identity = Array2::eye(triangle.nrows());
    Ok(f64::solve_square(triangle, identity.view())?)
}

/// The columns that are left, and what is needed to strike out the next.
struct Elimination<'a> {
    root: &'a Root,
    columns: Vec<usize>,
    /// $(\tilde H^T \tilde H + \lambda)^{-1}$ of the columns that are left, in its first rows and
    /// columns.
    inverse: Array2<f64>,
    /// Output weights, one row each.
    beta: Array2<f64>,
}

impl<'a> Elimination<'a> {
    fn new(root: &'a Root, columns: Vec<usize>) -> Result<Self> {
        let QrFactor { r, qtb, .. } = root.triangle(&columns)?;
        let upper = inverse(r.view())?;
        Ok(Self {
            root,
            columns,
            beta: f64::product(upper.view(), qtb.view()),
            inverse: f64::product(upper.view(), upper.t()),
        })
    }

    /// Whether so few neurons remain that recomputing the inverse is cheaper than updating it.
    fn is_due(&self) -> bool {
        4 * self.columns.len() < 3 * self.inverse.nrows()
    }

    /// The place of the neuron that costs least, among columns below `neurons`.
    fn cheapest(&self, neurons: usize) -> Option<usize> {
        let cost = |place: usize| {
            let beta = self.beta.row(place);
            let own = self.inverse[[place, place]].max(f64::MIN_POSITIVE);
            (&beta * &beta).dot(&self.root.output_weights) / own
        };
        (0..self.columns.len())
            .filter(|&place| self.columns[place] < neurons)
            .map(|place| (place, cost(place)))
            .min_by(|(_, a), (_, b)| a.total_cmp(b))
            .map(|(place, _)| place)
    }

    /// Strikes out the column at a place, and returns which it was.
    fn remove(&mut self, place: usize) -> usize {
        let left = self.columns.len();
        let last = left - 1;
        let gone = self.inverse.slice(s![place, ..left]).to_owned();
        let beta = self.beta.row(place).to_owned();
        let own = gone[place].max(f64::MIN_POSITIVE);
        for row in 0..left {
            let share = gone[row] / own;
            let mut inverse = self.inverse.slice_mut(s![row, ..left]);
            inverse.scaled_add(-share, &gone);
            self.beta.row_mut(row).scaled_add(-share, &beta);
        }
        // The last takes the place.
        let moved = self.inverse.slice(s![last, ..left]).to_owned();
        self.inverse.slice_mut(s![place, ..left]).assign(&moved);
        self.inverse.slice_mut(s![..left, place]).assign(&moved);
        self.inverse[[place, place]] = moved[last];
        let moved = self.beta.row(last).to_owned();
        self.beta.row_mut(place).assign(&moved);
        self.columns.swap_remove(place)
    }
}

/// The leave-one-out score of the networks of the first columns in this order, from `first` columns
/// on.
fn leave_one_out_scores(
    prepared: &EquilibratedProblem<f64>,
    root: &Root,
    order: &[usize],
    first: usize,
) -> Result<Vec<f64>> {
    // What is left of 1 by a leverage above this has digits enough.
    const RESOLVED: f64 = 1e-8;
    // Rows whose coordinates stay in the cache.
    const BLOCK: usize = 256;
    let EquilibratedProblem {
        hidden,
        targets,
        frame,
    } = prepared;
    let QrFactor { r, qtb, .. } = root.triangle(order)?;
    let upper = inverse(r.view())?;
    let constants = constant_shares(frame);
    let mut squares: Array2<f64> = Array2::zeros((order.len() + 1 - first, targets.ncols()));
    let blocks = hidden.axis_chunks_iter(Axis(0), BLOCK);
    let blocks = blocks.zip(targets.axis_chunks_iter(Axis(0), BLOCK));
    for ((hidden, targets), constants) in blocks.zip(constants.chunks(BLOCK)) {
        let along = f64::product(hidden.select(Axis(1), order).view(), upper.view());
        let rows = along.rows().into_iter().zip(targets.rows());
        for ((along, target), constant) in rows.zip(constants) {
            let mut residual = target.to_owned();
            let mut free = 1.0 - constant;
            for (used, (&q, weights)) in (1..).zip(along.iter().zip(qtb.rows())) {
                free -= q * q;
                residual.scaled_add(-q, &weights);
                if used >= first {
                    let mut sum = squares.row_mut(used - first);
                    if free > RESOLVED {
                        sum.zip_mut_with(&residual, |sum, r| *sum += (r / free).powi(2));
                    } else {
                        sum.fill(f64::INFINITY);
                    }
                }
            }
        }
    }
    let score = |squares: ArrayView1<'_, f64>| {
        let mean = squares.dot(&root.output_weights) / squares.len() as f64;
        mean.sqrt()
    };
    Ok(squares.rows().into_iter().map(score).collect())
}

/// The leverage that an intercept gives each row.
fn constant_shares(frame: &Equilibration<f64>) -> Vec<f64> {
    let direction = frame.constant_direction();
    direction.iter().map(|share| share * share).collect()
}
