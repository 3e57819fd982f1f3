//! From the scores of a linear solve to probabilities: one slope and a shift for each class.

use ndarray::{Array1, Array2, ArrayRef1, ArrayView1, ArrayView2, s};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

use crate::check::check_length;
#[cfg(feature = "serde")]
use crate::error::Error;
use crate::error::Result;
use crate::scalar::Scalar;
use crate::solve::Cholesky;

/// $p = \mathrm{softmax}(a f + b)$ of the scores $f$: a slope $a$ for all classes and a shift $b_k$ for
/// each (vector scaling with one slope: Guo, Pleiss, Sun and Weinberger, On Calibration of Modern Neural
/// Networks, 2017; for two classes Platt, Probabilistic Outputs for Support Vector Machines, 1999).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Parts"))]
pub struct Calibration {
    slope: f64,
    shifts: Vec<f64>,
}

/// A [`Calibration`] from outside.
#[cfg(feature = "serde")]
#[derive(Deserialize)]
struct Parts {
    slope: f64,
    shifts: Vec<f64>,
}

#[cfg(feature = "serde")]
impl TryFrom<Parts> for Calibration {
    type Error = Error;

    fn try_from(parts: Parts) -> Result<Self> {
        let in_range = |b: &f64| (-CERTAIN..=CERTAIN).contains(b);
        let all = parts.shifts.iter().all(in_range);
        if !all || !(0.0..=CERTAIN).contains(&parts.slope) {
            return Err(Error::Parameter {
                name: "slope or shift of a calibration",
                value: parts.slope,
                expected: "from 0 to 1e30, shifts from -1e30",
            });
        }
        Ok(Self {
            slope: parts.slope,
            shifts: parts.shifts,
        })
    }
}

/// Scores, slopes, shifts and log-odds of this size say that a class is certain. None is taken for larger, so
/// that no product or difference leaves the range of a type.
const CERTAIN: f64 = 1e30;
/// Newton's steps at most; the function is convex, and ten are usual.
const STEPS: usize = 50;
/// Twice what the loss may fall by, from where on whole steps converge: too little for values of the loss to
/// tell, whose rounding would leave half of the digits.
const NEAR: f64 = 1e-8;
/// Keeps shifts apart from their common sum, which probabilities do not depend on.
const DAMPING: f64 = 1e-9;
/// Work that a step may cost, in products.
const WORK: usize = 200_000_000;

impl Calibration {
    /// What makes the weighted log loss of these rows least: `scores` has shape (rows, classes), or one
    /// column for two classes, and should be of fits that have not seen the rows. So that the slope is finite
    /// where classes are separated without an error, a row counts for its own class less one part in the
    /// number of rows, which the others share (as Platt's targets do).
    pub(super) fn fit(
        scores: ArrayView2<'_, f64>,
        codes: &[usize],
        weights: Option<ArrayView1<'_, f64>>,
        classes: usize,
    ) -> Self {
        let scores = of_classes(scores);
        let stride = (codes.len() * classes * classes).div_ceil(WORK).max(1);
        let rows: Vec<usize> = (0..codes.len()).step_by(stride).collect();
        let weight = |row: usize| weights.map_or(1.0, |weights| weights[row]);
        let problem = Problem {
            scores: &scores,
            codes,
            total: rows.iter().map(|&row| weight(row)).sum(),
            weights: rows.iter().map(|&row| weight(row)).collect(),
            rows,
        };
        problem.solve()
    }

    /// What scores are multiplied by.
    #[must_use]
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// What is then added for each class.
    #[must_use]
    pub fn shifts(&self) -> &[f64] {
        &self.shifts
    }

    pub(super) fn check(&self, classes: usize) -> Result<()> {
        check_length("shifts of the calibration", self.shifts.len(), classes)
    }

    /// $a f + b$ in place of scores; of two classes the difference between them.
    pub(super) fn apply<A: Scalar>(&self, scores: &mut Array2<A>) {
        if scores.ncols() == 1 && self.shifts.len() == 2 {
            scores.mapv_inplace(|f| A::from_f64(self.of_second(f.as_f64())));
            return;
        }
        for (class, mut column) in scores.columns_mut().into_iter().enumerate() {
            column.mapv_inplace(|f| A::from_f64(self.of_class(class, f.as_f64())));
        }
    }

    /// The log-odds of a class with this score, up to a number common to all classes.
    pub(super) fn of_class(&self, class: usize, score: f64) -> f64 {
        held(self.slope * held(score) + self.shifts[class])
    }

    /// The log-odds of the second of two classes, whose score this is, against the first.
    pub(super) fn of_second(&self, score: f64) -> f64 {
        let shift = self.shifts[1] - self.shifts[0];
        held(self.slope * (2.0 * held(score) - 1.0) + shift)
    }
}

fn held(value: f64) -> f64 {
    value.clamp(-CERTAIN, CERTAIN)
}

/// A column for each class.
fn of_classes(scores: ArrayView2<'_, f64>) -> Array2<f64> {
    if scores.ncols() > 1 {
        return scores.to_owned();
    }
    Array2::from_shape_fn((scores.nrows(), 2), |(row, class)| {
        let second = scores[[row, 0]];
        if class == 1 { second } else { 1.0 - second }
    })
}

/// Probabilities in place of log-odds, $e^{z_k} / \sum_j e^{z_j}$.
pub(super) fn softmax<A: Scalar>(row: &mut ArrayRef1<A>) {
    let greatest = row.iter().fold(f64::NEG_INFINITY, |m, z| m.max(z.as_f64()));
    let sum: f64 = row.iter().map(|z| (z.as_f64() - greatest).exp()).sum();
    row.mapv_inplace(|z| A::from_f64((z.as_f64() - greatest).exp() / sum));
}

/// $1 / (1 + e^{-z})$, and one less that, each with all its digits.
pub(super) fn both_classes(z: f64) -> (f64, f64) {
    let small = (-z.abs()).exp();
    let (less, more) = (small / (1.0 + small), 1.0 / (1.0 + small));
    if z < 0.0 { (more, less) } else { (less, more) }
}

/// Rows, of which the log loss is made least.
struct Problem<'a> {
    scores: &'a Array2<f64>,
    codes: &'a [usize],
    rows: Vec<usize>,
    weights: Vec<f64>,
    total: f64,
}

impl Problem<'_> {
    fn classes(&self) -> usize {
        self.scores.ncols()
    }

    fn solve(&self) -> Calibration {
        let classes = self.classes();
        let mut point = Array1::zeros(classes + 1);
        // Where all that scores say is wrong, they are not used.
        for slope_is_free in [true, false] {
            point = self.descend(self.start(), slope_is_free);
            if point[0] > 0.0 {
                break;
            }
        }
        Calibration {
            slope: point[0].max(0.0),
            shifts: point.iter().skip(1).copied().collect(),
        }
    }

    /// No slope, and shifts that give each class its share.
    fn start(&self) -> Array1<f64> {
        let mut share = Array1::from_elem(self.classes() + 1, 1.0);
        for (&row, &weight) in self.rows.iter().zip(&self.weights) {
            share[self.codes[row] + 1] += weight;
        }
        let sum = share.sum() - 1.0;
        share.mapv_inplace(|w| (w / sum).ln());
        share[0] = 0.0;
        share
    }

    fn descend(&self, mut point: Array1<f64>, slope_is_free: bool) -> Array1<f64> {
        let mut loss = self.loss(&point);
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let (mut gradient, mut curvature) = self.derivatives(&point);
            if !slope_is_free {
                gradient[0] = 0.0;
                curvature.row_mut(0).fill(0.0);
                curvature.column_mut(0).fill(0.0);
                curvature[[0, 0]] = 1.0;
            }
            let step = Cholesky::new(curvature)
                .and_then(|factor| factor.solve(&gradient.view().insert_axis(ndarray::Axis(1))));
            let Ok(step) = step else { break };
            let mut step = step.column(0).to_owned();
            let fall = gradient.dot(&step);
            // Of the common sum the gradient says nothing but rounding, and the damping little against it.
            let common = step.slice(s![1..]).mean().unwrap_or(0.0);
            step.slice_mut(s![1..]).mapv_inplace(|shift| shift - common);
            if fall < NEAR {
                if fall >= last {
                    break;
                }
                point -= &step;
                last = fall;
                continue;
            }
            let Some((next, lower)) = self.search(&point, step.view(), loss) else {
                break;
            };
            (point, loss) = (next, lower);
        }
        point
    }

    /// The first of halved steps that lowers the loss.
    fn search(
        &self,
        point: &Array1<f64>,
        step: ArrayView1<'_, f64>,
        loss: f64,
    ) -> Option<(Array1<f64>, f64)> {
        let steps = (0..30).map(|halvings| 0.5_f64.powi(halvings));
        let at = |length: f64| point - &step.mapv(|s| s * length);
        let points = steps.map(at);
        let mut tried = points.map(|next| {
            let loss = self.loss(&next);
            (next, loss)
        });
        tried.find(|(_, new)| *new < loss)
    }

    /// What a row's own class counts for, and any other.
    fn target(&self) -> (f64, f64) {
        let share = 1.0 / (self.total + 2.0);
        (1.0 - share, share / (self.classes() as f64 - 1.0))
    }

    /// Log-odds of a row, made probabilities, and the log of their sum.
    fn probabilities(&self, row: usize, point: &Array1<f64>, p: &mut Array1<f64>) -> f64 {
        for (class, z) in p.iter_mut().enumerate() {
            *z = point[0] * self.scores[[row, class]] + point[class + 1];
        }
        let greatest = p.iter().fold(f64::NEG_INFINITY, |m: f64, z| m.max(*z));
        p.mapv_inplace(|z| (z - greatest).exp());
        let sum = p.sum();
        *p /= sum;
        greatest + sum.ln()
    }

    fn loss(&self, point: &Array1<f64>) -> f64 {
        let (own, other) = self.target();
        let mut p = Array1::zeros(self.classes());
        let mut loss = 0.0;
        for (&row, &weight) in self.rows.iter().zip(&self.weights) {
            let log_sum = self.probabilities(row, point, &mut p);
            let z = |class: usize| point[0] * self.scores[[row, class]] + point[class + 1];
            let all: f64 = (0..self.classes()).map(z).sum();
            loss += weight * (log_sum - (own - other) * z(self.codes[row]) - other * all);
        }
        let shifts: f64 = point.iter().skip(1).map(|b| b * b).sum();
        loss / self.total + 0.5 * DAMPING * shifts
    }

    fn derivatives(&self, point: &Array1<f64>) -> (Array1<f64>, Array2<f64>) {
        let classes = self.classes();
        let (own, other) = self.target();
        let mut p = Array1::zeros(classes);
        let mut gradient = Array1::zeros(classes + 1);
        let mut curvature = Array2::zeros((classes + 1, classes + 1));
        for (&row, &weight) in self.rows.iter().zip(&self.weights) {
            self.probabilities(row, point, &mut p);
            let scores = self.scores.row(row);
            let mean = scores.dot(&p);
            let share = weight / self.total;
            for class in 0..classes {
                let target = if class == self.codes[row] { own } else { other };
                let rest = share * (p[class] - target);
                gradient[0] += rest * scores[class];
                gradient[class + 1] += rest;
                let pull = share * p[class];
                curvature[[0, 0]] += pull * scores[class] * (scores[class] - mean);
                curvature[[class + 1, 0]] += pull * (scores[class] - mean);
                curvature[[class + 1, class + 1]] += pull;
                for before in 0..=class {
                    curvature[[class + 1, before + 1]] -= pull * p[before];
                }
            }
        }
        for class in 0..classes {
            gradient[class + 1] += DAMPING * point[class + 1];
        }
        curvature.diag_mut().mapv_inplace(|c| c + DAMPING);
        (gradient, curvature)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    /// Labels drawn by known log-odds give back slope and shift; the tolerance is four standard errors of
    /// 4000 draws.
    #[test]
    fn known_log_odds_are_found() {
        let n = 4000;
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as f64 / 2_f64.powi(31)
        };
        let scores = Array2::from_shape_simple_fn((n, 1), &mut uniform);
        let codes: Vec<usize> = scores
            .iter()
            .map(|f| usize::from(uniform() < both_classes(3.0 * (2.0 * f - 1.0) + 0.5).1))
            .collect();
        let found = Calibration::fit(scores.view(), &codes, None, 2);
        assert!((found.slope() - 3.0).abs() < 0.4, "{found:?}");
        assert!((found.shifts()[1] - found.shifts()[0] - 0.5).abs() < 0.2);
    }

    #[test]
    fn scores_that_are_wrong_are_not_used_and_separated_classes_have_a_finite_slope() {
        let scores = array![[1.0], [0.9], [0.1], [0.0]];
        let right = Calibration::fit(scores.view(), &[1, 1, 0, 0], None, 2);
        assert!(right.slope() > 1.0 && right.slope().is_finite());
        let wrong = Calibration::fit(scores.view(), &[0, 0, 1, 1], None, 2);
        assert_eq!(wrong.slope(), 0.0);
    }

    #[test]
    fn a_weight_of_two_is_two_rows() {
        let scores = array![
            [0.2, 0.5, 0.3],
            [0.7, 0.2, 0.1],
            [0.1, 0.3, 0.6],
            [0.4, 0.4, 0.2]
        ];
        let weights = array![2.0, 1.0, 3.0, 1.0];
        let codes = [1, 0, 2, 2];
        let weighted = Calibration::fit(scores.view(), &codes, Some(weights.view()), 3);
        let twice = [0, 0, 1, 2, 2, 2, 3];
        let repeated = scores.select(ndarray::Axis(0), &twice);
        let codes: Vec<usize> = twice.iter().map(|&row| codes[row]).collect();
        let all = Calibration::fit(repeated.view(), &codes, None, 3);
        approx::assert_relative_eq!(weighted.slope(), all.slope(), max_relative = 1e-6);
    }
}
