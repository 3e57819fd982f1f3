//! Leave-one-out scores of many strengths from rows that pass by a tile at a time.

use std::ops::Range;
use std::sync::Arc;

use ndarray::{Array2, ArrayView1, ArrayView2, Axis, Zip};

use super::Route;
use super::close_rows::{self, CLOSE};
use super::design_svd::DesignSvd;
use super::leave_one_out::Scores;
use super::tiles::Tiles;
use crate::error::Result;
use crate::linalg::Backend;
use crate::scalar::Scalar;
use crate::threads;

/// As [`scores`](super::leave_one_out::scores), from one more pass over the rows of `spectrum`.
///
/// A row has the coordinates $u = \tilde h V / s$ in the singular vectors. Where it all but determines its
/// own fit, $1 - \sum_j u_j^2$ has no digits left: there are no more such rows than neurons, and these are
/// compared with the fit of the others. Nothing where they are too many for that.
///
/// # Errors
/// Those of making the rows and of the factorizations.
pub(super) fn scores_of_tiles<A: Scalar>(
    tiles: &mut Tiles<'_, '_, A>,
    spectrum: &DesignSvd<f64>,
    candidates: &[f64],
    roundoff: f64,
) -> Result<Option<Array2<f64>>> {
    let mean = spectrum.means();
    let lightest = Light::limit(spectrum.condition());
    // Where half of the rows would be done again, the first time is lost.
    let leverage = spectrum.s.len() as f64 / spectrum.frame.weighted_rows as f64;
    let single = spectrum.route == Route::GramSvd && leverage < 0.7 * lightest;
    let weak = spectrum.weakest.is_some();
    let pass = Pass {
        to_u: Arc::new(&spectrum.vt.t() / &spectrum.s),
        scores: Scores::new(spectrum, candidates, single),
        close: Vec::new(),
        closest: if weak {
            least_freedom(candidates)
        } else {
            CLOSE
        },
    };
    let light = single.then(|| Light::new(spectrum, candidates, lightest));
    let seen = &*tiles;
    let score = |part: Range<usize>| {
        let (mut pass, mut memory) = (pass.clone(), seen.memory());
        for range in seen.ranges(part) {
            if weak && pass.close.len() > close_rows::MOST {
                break;
            }
            let first = range.start;
            let tile = seen.tile(range.clone(), &mean, &mut memory)?;
            let Some(light) = &light else {
                pass.add(tile, &range.collect::<Vec<_>>());
                continue;
            };
            let heavy = light.add(tile, &mut pass.scores.sums);
            if !heavy.is_empty() {
                let rows: Vec<usize> = heavy.iter().map(|row| first + row).collect();
                pass.add(tile.select(Axis(0), &heavy).view(), &rows);
            }
        }
        Ok(pass)
    };
    let passed = threads::reduce(seen.parts(), score, |all, part| {
        all.scores.sums += &part.scores.sums;
        all.close.extend(part.close);
    })?;
    let mut pass = passed.unwrap_or(pass);
    if single {
        pass.scores.sums += &squared_residuals(spectrum, candidates);
    }
    if !pass.close.is_empty() {
        let close = &pass.close;
        pass.scores.sums += &if !weak {
            close_rows::by_triangle(tiles, spectrum, close, candidates, single)?
        } else if close.len() <= close_rows::MOST {
            close_rows::by_sums(tiles, spectrum, close, candidates, single)?
        } else {
            return Ok(None);
        };
    }
    Ok(Some(pass.scores.finish(candidates, roundoff)))
}

/// The squared residuals of each candidate and output, which the spectrum knows: the least that scores
/// can be. Shape (candidates, outputs).
pub(super) fn squared_residuals(spectrum: &DesignSvd<f64>, candidates: &[f64]) -> Array2<f64> {
    let mut sums = Array2::zeros((candidates.len(), spectrum.c.ncols()));
    for (mut row, &lambda) in sums.rows_mut().into_iter().zip(candidates) {
        let held = spectrum.filter_complements(lambda);
        let left = (&spectrum.c * &held.insert_axis(Axis(1))).mapv_into(|c| c * c);
        row.assign(&(left.sum_axis(Axis(0)) + &spectrum.residual_ss));
    }
    sums
}

/// [`CLOSE`] where sums of products leave $\epsilon / \lambda$ of error in a leverage: that must be less
/// than a ten thousandth of it.
fn least_freedom(candidates: &[f64]) -> f64 {
    let weakest = candidates.iter().copied().fold(f64::INFINITY, f64::min);
    CLOSE.max(1e4 * f64::EPSILON / weakest)
}

/// A pass over rows in `f64`.
#[derive(Clone)]
struct Pass<'p> {
    /// What takes a row to its coordinates in the left singular vectors.
    to_u: Arc<Array2<f64>>,
    scores: Scores<'p, f64>,
    /// Rows that all but determine their own fit: with less freedom than `closest`.
    close: Vec<usize>,
    closest: f64,
}

impl Pass<'_> {
    /// Scores the rows of a tile, of these numbers, or notes that they are close.
    fn add(&mut self, tile: ArrayView2<'_, f64>, rows: &[usize]) {
        let spectrum = self.scores.spectrum;
        let (hidden, rest) = tile.split_at(Axis(1), self.to_u.nrows());
        let (targets, ones) = rest.split_at(Axis(1), spectrum.c.ncols());
        let u = f64::product(hidden, self.to_u.view());
        let residual = &targets - &f64::product(u.view(), spectrum.c.view());
        let squared = u.mapv(|u| u * u);
        let mut one_minus_leverage = squared.map_axis(Axis(1), |row| 1.0 - row.sum());
        if let Some(roots) = ones.columns().into_iter().next() {
            let total = spectrum.frame.total_weight;
            Zip::from(&mut one_minus_leverage)
                .and(roots)
                .for_each(|one_minus_leverage, root| *one_minus_leverage -= root * root / total);
        }
        // What the weakest strength leaves of them; the others leave more.
        let mut free = squared.dot(&self.scores.complements.column(0));
        free += &one_minus_leverage;
        if free.iter().all(|free| *free >= self.closest) {
            self.scores
                .add(u.view(), residual.view(), one_minus_leverage.view());
            return;
        }
        let (far, near): (Vec<usize>, Vec<usize>) =
            (0..free.len()).partition(|&row| free[row] >= self.closest);
        self.scores.add(
            u.select(Axis(0), &far).view(),
            residual.select(Axis(0), &far).view(),
            one_minus_leverage.select(Axis(0), &far).view(),
        );
        self.close.extend(near.iter().map(|&row| rows[row]));
    }
}

/// A pass over rows in `f32`, for those that have little leverage.
///
/// Leave-one-out adds $e_i^2 ((1 - h_i)^{-2} - 1)$ to a squared residual, which an error of $\delta$ in
/// $h_i$ changes by $2 \delta (1 - h_i)^{-3}$ of that. The leverage $h_i$ is off by as much of itself as the
/// condition $\kappa$ multiplies the rounding of single precision by. Where
/// $\kappa h_i (1 - h_i)^{-3}$ is at most 21, as it is for leverages of 0.02 and a condition of 1000, the sum
/// over rows is off by 3e-6 of itself at most, and as the errors of rows have nothing to do with each other
/// by far less.
struct Light {
    /// The leverage up to which rows are light.
    limit: f32,
    to_u: Array2<f32>,
    /// What each candidate keeps of each direction, shape (directions, candidates).
    kept: Array2<f32>,
    /// Of each output the output weights of all candidates, shape (neurons, candidates).
    beta: Vec<Array2<f32>>,
    total_weight: f32,
}

impl Light {
    /// The leverage up to which rows of a problem of this condition are light; nothing above 1000.
    fn limit(condition: f64) -> f64 {
        let ratio = 21.0 / condition;
        // Satisfies h / (1 - h)^3 <= ratio, and leaves the differences from 1 their digits.
        let limit = (ratio / (1.0 + 3.0 * ratio)).min(0.25);
        if condition <= 1e3 { limit } else { 0.0 }
    }

    fn new(spectrum: &DesignSvd<f64>, candidates: &[f64], limit: f64) -> Self {
        let narrow = |values: &Array2<f64>| values.mapv(f32::from_f64);
        let mut kept = Array2::zeros((spectrum.s.len(), candidates.len()));
        for (mut column, &lambda) in kept.columns_mut().into_iter().zip(candidates) {
            column.assign(&spectrum.filter_factors(lambda));
        }
        let gain = &kept / &spectrum.s.view().insert_axis(Axis(1));
        let beta = |c: ArrayView1<'_, f64>| {
            let along = &gain * &c.insert_axis(Axis(1));
            narrow(&f64::product(spectrum.vt.t(), along.view()))
        };
        Self {
            limit: f32::from_f64(limit),
            to_u: narrow(&(&spectrum.vt.t() / &spectrum.s)),
            beta: spectrum.c.columns().into_iter().map(beta).collect(),
            kept: narrow(&kept),
            total_weight: f32::from_f64(spectrum.frame.total_weight),
        }
    }

    /// Adds what leave-one-out adds for the rows of a tile to `sums`, shape (candidates, outputs); returns
    /// those that have too much leverage, and have not been added.
    fn add(&self, tile: ArrayView2<'_, f64>, sums: &mut Array2<f64>) -> Vec<usize> {
        let neurons = self.to_u.nrows();
        let (hidden, rest) = tile.split_at(Axis(1), neurons);
        let (targets, ones) = rest.split_at(Axis(1), self.beta.len());
        let hidden = hidden.mapv(f32::from_f64);
        let mut squared = f32::product(hidden.view(), self.to_u.view());
        squared.mapv_inplace(|u| u * u);
        let mut leverages = f32::product(squared.view(), self.kept.view());
        let mut most = squared.sum_axis(Axis(1));
        if let Some(roots) = ones.columns().into_iter().next() {
            let own = roots.mapv(|root| f32::from_f64(root * root) / self.total_weight);
            most += &own;
            leverages += &own.insert_axis(Axis(1));
        }
        leverages.mapv_inplace(|h| h * (2.0 - h) / ((1.0 - h) * (1.0 - h)));
        // What is not a number is heavy, too.
        let heavy: Vec<usize> = (0..most.len())
            .filter(|&row| !(0.0..=self.limit).contains(&most[row]))
            .collect();
        for &row in &heavy {
            leverages.row_mut(row).fill(0.0);
        }
        let outputs = targets.columns().into_iter().zip(&self.beta);
        for ((targets, beta), mut sums) in outputs.zip(sums.columns_mut()) {
            let fitted = f32::product(hidden.view(), beta.view());
            for ((fitted, added), &target) in
                fitted.rows().into_iter().zip(leverages.rows()).zip(targets)
            {
                Zip::from(&mut sums)
                    .and(fitted)
                    .and(added)
                    .for_each(|sum, &fitted, &added| {
                        if added > 0.0 {
                            *sum += (target - f64::from(fitted)).powi(2) * f64::from(added);
                        }
                    });
            }
        }
        heavy
    }
}
