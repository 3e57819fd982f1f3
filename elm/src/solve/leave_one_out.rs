//! Leave-one-out scores of many strengths at once: from the rows of a factorisation, or from rows
//! that pass by a tile at a time.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip, s};

use super::spectrum::{RowSpectrum, Spectrum};
use super::tiles::Tiles;
use crate::error::Result;
use crate::linalg::{Kernel, Triangular};
use crate::scalar::Scalar;

/// The share of a score that rounding errors must have for them to be looked at closely.
pub(super) const NEGLIGIBLE: f64 = 1e-6;

/// Rows whose leave-one-out residuals are computed together, for all candidates.
const SCORED_ROWS: usize = 256;

/// Sums of squared leave-one-out residuals, under way.
///
/// Rows pass by once, a block of them for all candidates: products of matrices, where a candidate
/// by itself would read all rows for a product with a vector.
struct Scores<'p, A: Scalar> {
    spectrum: &'p Spectrum<A>,
    /// What each candidate holds back of each direction, shape (directions, candidates).
    held_back: Array2<A>,
    /// Shape (candidates, outputs), in units of the scaled targets.
    sums: Array2<f64>,
}

impl<'p, A: Scalar> Scores<'p, A> {
    fn new(spectrum: &'p Spectrum<A>, candidates: &[f64]) -> Self {
        let mut held_back = Array2::zeros((spectrum.s.len(), candidates.len()));
        for (mut column, &lambda) in held_back.columns_mut().into_iter().zip(candidates) {
            column.assign(&spectrum.ridge_held_back(A::from_f64(lambda)));
        }
        Self {
            spectrum,
            held_back,
            sums: Array2::zeros((candidates.len(), spectrum.c.ncols())),
        }
    }

    /// Adds rows, given what [`RowSpectrum`] knows of them.
    fn add(&mut self, u: ArrayView2<'_, A>, residual: ArrayView2<'_, A>, free: ArrayView1<'_, A>) {
        let squared = u.mapv(|u| u * u);
        let mut denominators = A::product(squared.view(), self.held_back.view());
        denominators += &free.insert_axis(Axis(1));
        let c = self.spectrum.c.view();
        for (output, mut score) in self.sums.columns_mut().into_iter().enumerate() {
            let held = &self.held_back * &c.slice(s![.., output..=output]);
            let mut residuals = A::product(u, held.view());
            residuals += &residual.slice(s![.., output..=output]);
            residuals /= &denominators;
            for row in residuals.rows() {
                Zip::from(&mut score)
                    .and(row)
                    .for_each(|score, e| *score += e.as_f64().powi(2));
            }
        }
    }

    /// The scores, with what rounding is to add to them.
    fn finish(self, candidates: &[f64], roundoff: f64) -> Array2<f64> {
        let mut sums = self.sums;
        for (mut score, &lambda) in sums.rows_mut().into_iter().zip(candidates) {
            let kept = self.spectrum.ridge_kept(A::from_f64(lambda));
            let negligible = |o: usize| NEGLIGIBLE * score[o];
            let rounding = self.spectrum.rounding_squares(&kept, roundoff, negligible);
            for (score, rounding) in score.iter_mut().zip(rounding) {
                *score += rounding;
            }
        }
        sums
    }
}

/// The sum of squared leave-one-out residuals, and of what rounding is to add to them, for each
/// candidate and output, shape (candidates, outputs), in units of the scaled targets.
pub(super) fn scores<A: Scalar>(
    rows: &RowSpectrum<A>,
    candidates: &[f64],
    roundoff: f64,
) -> Array2<f64> {
    let mut scores = Scores::new(&rows.spectrum, candidates);
    for first in (0..rows.u.nrows()).step_by(SCORED_ROWS) {
        let block = first..rows.u.nrows().min(first + SCORED_ROWS);
        scores.add(
            rows.u.slice(s![block.clone(), ..]),
            rows.residual.slice(s![block.clone(), ..]),
            rows.free.slice(s![block]),
        );
    }
    scores.finish(candidates, roundoff)
}

/// As [`scores`], from one more pass over the rows of `spectrum`, whose [`unreached`] is set to the
/// squares that the rows show.
///
/// A row has the coordinates $u = \tilde h V / s$ in the singular vectors. Where it all but determines its
/// own fit, $1 - \sum_j u_j^2$ has no digits left: there are no more such rows than neurons, and these are
/// scored from a problem in which the triangle of the other rows stands for them.
///
/// # Errors
/// Those of making the rows and of the factorisations.
///
/// [`unreached`]: Spectrum::unreached
pub(super) fn scores_of_tiles<A: Scalar>(
    tiles: &mut Tiles<'_, '_, A>,
    spectrum: &mut Spectrum<f64>,
    candidates: &[f64],
    roundoff: f64,
) -> Result<Array2<f64>> {
    /// Freedom below which a difference from 1 is not relied on.
    const CLOSE: f64 = 1e-4;
    let neurons = tiles.neurons();
    let mean = means(spectrum);
    let to_u = &spectrum.vt.t() / &spectrum.s;
    let total = spectrum.frame.total_weight;
    let mut unreached = Array1::<f64>::zeros(tiles.outputs());
    let mut scores = Scores::new(spectrum, candidates);
    let mut close: Vec<usize> = Vec::new();
    for range in tiles.ranges() {
        let first = range.start;
        let tile = tiles.tile(range, &mean)?;
        let (hidden, rest) = tile.split_at(Axis(1), neurons);
        let (targets, ones) = rest.split_at(Axis(1), spectrum.c.ncols());
        let u = f64::product(hidden, to_u.view());
        let residual = &targets - &f64::product(u.view(), spectrum.c.view());
        unreached += &residual.map_axis(Axis(0), |column| column.dot(&column));
        let mut free = u.map_axis(Axis(1), |row| 1.0 - row.dot(&row));
        if let Some(roots) = ones.columns().into_iter().next() {
            Zip::from(&mut free)
                .and(roots)
                .for_each(|free, root| *free -= root * root / total);
        }
        if free.iter().all(|free| *free >= CLOSE) {
            scores.add(u.view(), residual.view(), free.view());
            continue;
        }
        let (far, near): (Vec<usize>, Vec<usize>) =
            (0..free.len()).partition(|&row| free[row] >= CLOSE);
        scores.add(
            u.select(Axis(0), &far).view(),
            residual.select(Axis(0), &far).view(),
            free.select(Axis(0), &far).view(),
        );
        close.extend(near.iter().map(|row| first + row));
    }
    let mut sums = scores.sums.clone();
    if !close.is_empty() {
        sums += &scores_of_close_rows(tiles, spectrum, &mean, &close, candidates)?;
    }
    scores.sums = sums;
    let scores = scores.finish(candidates, roundoff);
    spectrum.unreached = unreached;
    Ok(scores)
}

/// Of hidden values and targets, in units of their scale.
fn means(spectrum: &Spectrum<f64>) -> Vec<f64> {
    let frame = &spectrum.frame;
    let hidden = &frame.hidden_mean / frame.hidden_scale;
    let targets = &frame.target_mean / &frame.target_scale;
    hidden.iter().chain(&targets).copied().collect()
}

/// The squared leave-one-out residuals of rows that all but determine their own fit.
///
/// Rows are interchangeable with any others that have the same sums of products: for those that are
/// not `close` their triangle stands, of which the row of the ones is what an intercept makes of them.
fn scores_of_close_rows<A: Scalar>(
    tiles: &mut Tiles<'_, '_, A>,
    spectrum: &Spectrum<f64>,
    mean: &[f64],
    close: &[usize],
    candidates: &[f64],
) -> Result<Array2<f64>> {
    let neurons = tiles.neurons();
    let outputs = tiles.outputs();
    let intercept = spectrum.frame.intercept;
    let Triangular { r, qtb, .. } = tiles.triangle_without(close, mean)?;
    let extra = usize::from(intercept);
    let (ones, others) = r.view().split_at(Axis(1), extra);
    let mut own = Array2::zeros((close.len(), neurons + outputs + extra));
    for (mut to, &row) in own.rows_mut().into_iter().zip(close) {
        to.assign(&tiles.tile(row..row + 1, mean)?.row(0));
    }
    let (own_hidden, rest) = own.view().split_at(Axis(1), neurons);
    let (own_targets, own_ones) = rest.split_at(Axis(1), outputs);
    let stack = |a: ArrayView2<'_, f64>, b: ArrayView2<'_, f64>| {
        let mut both = Array2::zeros((a.nrows() + b.nrows(), a.ncols()));
        let (mut top, mut bottom) = both.view_mut().split_at(Axis(0), a.nrows());
        top.assign(&a);
        bottom.assign(&b);
        both
    };
    let hidden = stack(others, own_hidden);
    let targets = stack(qtb.view(), own_targets);
    let constant = stack(ones, own_ones)
        .columns()
        .into_iter()
        .next()
        .map_or(Array1::zeros(hidden.nrows()), |ones| {
            &ones / spectrum.frame.total_weight.sqrt()
        });
    let none = Array1::zeros(hidden.nrows());
    let rows = RowSpectrum::of_rows(hidden, targets, constant, none, spectrum.frame.clone())?;
    let mut scores = Scores::new(&rows.spectrum, candidates);
    let from = rows.u.nrows() - close.len();
    scores.add(
        rows.u.slice(s![from.., ..]),
        rows.residual.slice(s![from.., ..]),
        rows.free.slice(s![from..]),
    );
    Ok(scores.sums)
}
