//! Leave-one-out scores of rows that all but determine their own fit. A difference from 1, which is what
//! their leverage leaves, has no digits then, and neither has their residual; compared with the fit of the
//! other rows they are as good as any.

use ndarray::{Array1, Array2, Axis, concatenate, s};

use super::design_svd::{DesignSvd, DesignSvdWithRows};
use super::leave_one_out::Scores;
use super::tiles::Tiles;
use crate::error::Result;
use crate::linalg::{Backend, Eigen, QrFactor};
use crate::scalar::Scalar;

/// Freedom below which a difference from 1 is not relied on.
pub(super) const CLOSE: f64 = 1e-4;

/// The most rows that [`by_sums`] should be given: each strength has a factorization of a matrix of as many.
pub(super) const MOST: usize = 128;

/// The sums of the squared leave-one-out residuals of rows, or of their `excess` over squared residuals, from
/// sums of products of the others; shape (candidates, outputs).
///
/// # Errors
/// Those of making the rows and of the factorizations.
pub(super) fn by_sums<A: Scalar>(
    tiles: &Tiles<'_, '_, A>,
    spectrum: &DesignSvd<f64>,
    close: &[usize],
    candidates: &[f64],
    excess: bool,
) -> Result<Array2<f64>> {
    let mut own = Own::of_tiles(tiles, &spectrum.means(), close)?;
    own.hidden = f64::product(own.hidden.view(), spectrum.vt.t());
    let DesignSvd { s, c, frame, .. } = spectrum;
    let weight = frame.intercept.then_some(frame.total_weight);
    own.scores((s, c), weight, candidates, excess)
}

/// As [`by_sums`], from the triangle of the others.
///
/// Rows are interchangeable with any others that have the same sums of products: for those that are
/// not `close` their triangle stands, of which the row of the ones is what an intercept makes of them.
///
/// # Errors
/// Those of making the rows and of the factorizations.
pub(super) fn by_triangle<A: Scalar>(
    tiles: &mut Tiles<'_, '_, A>,
    spectrum: &DesignSvd<f64>,
    close: &[usize],
    candidates: &[f64],
    excess: bool,
) -> Result<Array2<f64>> {
    let means = spectrum.means();
    let QrFactor { r, qtb, .. } = tiles.triangle_without(close, &means)?;
    let Own {
        hidden: own_hidden,
        targets: own_targets,
        roots,
    } = Own::of_tiles(tiles, &means, close)?;
    let extra = usize::from(spectrum.frame.intercept);
    let (ones, others) = r.view().split_at(Axis(1), extra);
    let hidden = concatenate![Axis(0), others, own_hidden];
    let targets = concatenate![Axis(0), qtb, own_targets];
    let constant = match ones.columns().into_iter().next() {
        Some(ones) => concatenate![Axis(0), ones, roots] / spectrum.frame.total_weight.sqrt(),
        None => Array1::zeros(hidden.nrows()),
    };
    let none = Array1::zeros(hidden.nrows());
    let rows = DesignSvdWithRows::of_rows(hidden, targets, constant, none, spectrum.frame.clone())?;
    let mut scores = Scores::new(&rows.spectrum, candidates, excess);
    let from = rows.u.nrows() - close.len();
    scores.add(
        rows.u.slice(s![from.., ..]),
        rows.residual.slice(s![from.., ..]),
        rows.one_minus_leverage.slice(s![from..]),
    );
    scores.doubt(&rows, from);
    Ok(scores.sums)
}

/// The rows themselves, less the means of all.
struct Own {
    hidden: Array2<f64>,
    targets: Array2<f64>,
    /// Of their weights; hidden values and targets are multiplied by these.
    roots: Array1<f64>,
}

impl Own {
    fn of_tiles<A: Scalar>(
        tiles: &Tiles<'_, '_, A>,
        means: &[f64],
        close: &[usize],
    ) -> Result<Self> {
        let mut rows = Array2::zeros((close.len(), tiles.source.width()));
        let mut memory = tiles.memory();
        for (mut to, &row) in rows.rows_mut().into_iter().zip(close) {
            to.assign(&tiles.tile(row..row + 1, means, &mut memory)?.row(0));
        }
        let (hidden, rest) = rows.view().split_at(Axis(1), tiles.neurons());
        Ok(Self {
            hidden: hidden.to_owned(),
            targets: rest.slice(s![.., ..tiles.outputs()]).to_owned(),
            roots: tiles.frame.root_weights.select(Axis(0), close),
        })
    }

    /// The scores, of rows in the coordinates of the singular vectors of all rows, which have the singular
    /// values $s$, the targets' coordinates $c$ and, where there is an intercept, this total weight.
    ///
    /// With $K = H^T H + \lambda I$ of the other rows, centered on these, the residuals of the close ones,
    /// where all rows are fitted, are $e = A^{-1} (T_c - H_c K^{-1} H^T T)$ with $A = I + H_c K^{-1}
    /// H_c^T$, and the diagonal of $A^{-1}$ is what leverages leave of 1. Nothing cancels.
    fn scores(
        mut self,
        (lengths, c): (&Array1<f64>, &Array2<f64>),
        weight: Option<f64>,
        candidates: &[f64],
        excess: bool,
    ) -> Result<Array2<f64>> {
        // Of the others: all less these.
        let squares = lengths.mapv(|s| s * s);
        let mut products = Array2::from_diag(&squares);
        products -= &f64::product(self.hidden.t(), self.hidden.view());
        let mut right = c * &lengths.view().insert_axis(Axis(1));
        right -= &f64::product(self.hidden.t(), self.targets.view());
        let mut constant = Array2::zeros((self.roots.len(), self.roots.len()));
        if let Some(all) = weight {
            let weight = all - self.roots.dot(&self.roots);
            let roots = self.roots.view().insert_axis(Axis(1));
            // Deviations from the mean of all add up to nothing.
            let hidden = f64::product(roots.t(), self.hidden.view()) / -weight;
            let targets = f64::product(roots.t(), self.targets.view()) / -weight;
            products -= &(f64::product(hidden.t(), hidden.view()) * weight);
            right -= &(f64::product(hidden.t(), targets.view()) * weight);
            self.hidden -= &f64::product(roots, hidden.view());
            self.targets -= &f64::product(roots, targets.view());
            constant = f64::product(roots, roots.t()) / weight;
        }
        let Eigen { values, vt } = f64::eigen(products.view())?;
        let along = f64::product(self.hidden.view(), vt.t());
        let right = f64::product(vt.view(), right.view());
        let count = self.roots.len();
        let mut sides = Array2::zeros((count, count + right.ncols()));
        sides.diag_mut().fill(1.0);
        let mut scores = Array2::zeros((candidates.len(), right.ncols()));
        for (&strength, mut scores) in candidates.iter().zip(scores.rows_mut()) {
            let lambda = strength * squares[0];
            let held = &along / &values.mapv(|value| value + lambda);
            let mut a = f64::product(held.view(), along.t()) + &constant;
            a.diag_mut().mapv_inplace(|value| value + 1.0);
            let left = &self.targets - &f64::product(held.view(), right.view());
            sides.slice_mut(s![.., count..]).assign(&left);
            let solved = f64::solve_positive(a.view(), sides.view())?.x;
            for (row, solved) in solved.rows().into_iter().enumerate() {
                for (score, left) in scores.iter_mut().zip(solved.slice(s![count..])) {
                    let counted = if excess { left.powi(2) } else { 0.0 };
                    *score += (left / solved[row]).powi(2) - counted;
                }
            }
        }
        Ok(scores)
    }
}
