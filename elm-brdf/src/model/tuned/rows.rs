//! A layer at the rows and at the anchors of a problem, as sums of products.

use elm::advanced::FeatureMap;
use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};

use super::errors::no_fit;
use super::normal_equations::{NormalEquations, WEAKEST};
use super::problem::Problem;
use crate::error::Result;

/// Rows whose hidden-layer matrix is there at a time.
pub(super) const TILE: usize = 4096;
/// Strengths tried: two to a decade from [`WEAKEST`].
pub(super) const STRENGTHS: usize = 29;
/// What anchors count at first, against what their guess is worth.
pub(super) const ANCHORED: f64 = 1e-3;

/// A layer at the rows.
pub(super) struct Rows {
    pub(super) total: NormalEquations,
    /// What strengths are relative to.
    pub(super) scale: f64,
    pub(super) folds: Vec<NormalEquations>,
    /// The hidden-layer matrix of the validation rows.
    pub(super) validation: Array2<f64>,
}

impl Rows {
    pub(super) fn new(
        problem: &Problem<'_>,
        map: &FeatureMap<f64>,
        x: &Array2<f64>,
    ) -> Result<Self> {
        let validation = map.transform(&x.select(Axis(0), problem.validation()))?;
        let of = |h: ArrayView2<'_, f64>, rows: &[usize]| {
            NormalEquations::of(
                h,
                problem.targets(rows).view(),
                problem.weights(rows).as_ref(),
            )
        };
        let mut folds: Vec<NormalEquations> = Vec::new();
        let mut first = 0;
        for fold in problem.folds() {
            let range = Slice::from(first..first + fold.len());
            folds.push(of(validation.slice_axis(Axis(0), range), fold));
            first += fold.len();
        }
        let mut parts = folds.iter();
        let mut total = parts.next().ok_or_else(no_fit)?.clone();
        parts.for_each(|part| total.add(part, 1.0));
        let mut is_judged = vec![false; x.nrows()];
        for &row in problem.validation() {
            is_judged[row] = true;
        }
        let rest: Vec<usize> = (0..x.nrows()).filter(|&row| !is_judged[row]).collect();
        for tile in rest.chunks(TILE) {
            let h = map.transform(&x.select(Axis(0), tile))?;
            total.add(&of(h.view(), tile), 1.0);
        }
        Ok(Self {
            scale: total.scale(),
            total,
            folds,
            validation,
        })
    }

    /// The steps about a known strength.
    pub(super) fn near(&self, strength: f64) -> std::ops::Range<usize> {
        let step = (2.0 * (strength / self.scale / WEAKEST).log10()).round() as usize;
        step.saturating_sub(1)..(step + 4).min(STRENGTHS)
    }
}

/// The anchors of a layer.
pub(super) struct Pull {
    /// Their hidden-layer matrix, and their weights.
    pub(super) h: Array2<f64>,
    pub(super) weights: Array1<f64>,
    /// Without the measurements of each fold, and with all.
    pub(super) without: Vec<NormalEquations>,
    pub(super) all: NormalEquations,
    /// So many times their weight.
    pub(super) times: f64,
}

impl Pull {
    /// `variances` are those of the targets about the network.
    pub(super) fn new(problem: &Problem<'_>, h: Array2<f64>, variances: &[f64]) -> Self {
        let weights = problem.anchor_weights(variances);
        let guesses = problem.guesses_of_targets(|_| true);
        let all = NormalEquations::of(h.view(), guesses.view(), Some(&weights));
        let mut first = 0;
        let without = problem.folds().iter().map(|fold| {
            let range = first..first + fold.len();
            first = range.end;
            let guesses = problem.guesses_of_targets(|place| !range.contains(&place));
            all.again(&h, &guesses, Some(&weights))
        });
        let without = without.collect();
        Self {
            without,
            all,
            h,
            weights,
            times: ANCHORED,
        }
    }
}
