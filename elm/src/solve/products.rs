//! Singular values of many rows from their sums of products: half the arithmetic of a triangle, for problems
//! whose condition, or whose strength of ridge, leaves these their digits.

use ndarray::{Array2, Axis, ShapeBuilder, s};

use super::Route;
use super::design_svd::DesignSvd;
use super::gram::{self, Sums};
use super::normal_equations::NormalEquations;
use super::tiles::{MIN_SAMPLE, Tiles};
use crate::error::Result;
use crate::linalg::{Backend, Eigen};
use crate::scalar::Scalar;
use crate::threads;

/// Whether the condition of these sums of products may be one that they are good for: inverse iteration
/// bounds the smallest eigenvalue from above, and comes near it, columns bound the largest from below.
fn may_be_conditioned(products: Array2<f64>) -> bool {
    const STEPS: usize = 4;
    let largest = products.diag().fold(0.0, |m: f64, v| m.max(*v));
    // Without a factor the condition is far beyond what is asked for.
    let Ok(factor) = f64::cholesky(products) else {
        return false;
    };
    let mut vector: Array2<f64> = Array2::from_elem((factor.nrows(), 1), 1.0);
    let mut smallest = f64::INFINITY;
    for _ in 0..STEPS {
        let length = vector.column(0).dot(&vector.column(0)).sqrt();
        vector /= length;
        let Ok(half) = f64::solve_lower(&factor, vector.view()) else {
            return false;
        };
        // The inverse's Rayleigh quotient.
        smallest = smallest.min(half.column(0).dot(&half.column(0)).recip());
        let Ok(next) = f64::solve_lower_transposed(&factor, half.view()) else {
            return false;
        };
        vector = next;
    }
    gram::allowed::<f64>(smallest / largest)
}

/// Whether sums of products may do for a search: by their condition, or by the strength that is called for.
fn may_do(sums: &Sums) -> bool {
    let finite = sums.products.iter().all(|value| value.is_finite());
    finite && (may_be_conditioned(sums.products.clone()) || gram::holds_back(sums))
}

impl<A: Scalar> Tiles<'_, '_, A> {
    /// Sums of products of rows from everywhere, enough to tell whether those of all rows may do; nothing
    /// where these would not take longer.
    ///
    /// # Errors
    /// Those of making the rows.
    fn sample_sums(&mut self) -> Result<Option<Sums>> {
        let some = self.sample_rows();
        if some > self.rows() / 4 {
            self.look(MIN_SAMPLE)?;
            return Ok(None);
        }
        let sample = self.look(some)?;
        let neurons = self.neurons();
        let sums = f64::gram(sample.slice(s![.., ..neurons + self.outputs()]));
        Ok(Some(Sums {
            products: sums.slice(s![..neurons, ..neurons]).to_owned(),
            right: sums.slice(s![neurons.., ..neurons]).t().to_owned(),
            squares: sums.slice(s![neurons.., neurons..]).diag().to_owned(),
            rows: sample.nrows() as f64,
        }))
    }

    /// As [`spectrum_of_triangle`](Self::spectrum_of_triangle), by the singular values of the sums of
    /// products: for every strength where these are well enough conditioned, else for strong ones; or nothing
    /// where a weaker one is called for, or the targets are explained down to where sums of squares have no
    /// digits.
    ///
    /// # Errors
    /// Those of making the rows and of the factorization.
    pub(super) fn spectrum_of_products(&mut self) -> Result<Option<DesignSvd<f64>>> {
        let sample = self.sample_sums()?;
        if sample.as_ref().is_some_and(|sums| !may_do(sums)) {
            return Ok(None);
        }
        let width = self.source.width();
        let rows = &*self;
        let zeros = || Array2::zeros((width, width).f());
        let memory = || (rows.memory(), Vec::new());
        let sums = threads::sum(self.parts(), zeros, memory, |memory, part, sums| {
            let (memory, scratch) = memory;
            for range in rows.ranges(part) {
                if !rows.is_empty(range.clone()) {
                    f64::add_gram(rows.tile(range, &rows.shift, memory)?, sums, scratch);
                }
            }
            Ok(())
        })?;
        let sums = sums.unwrap_or_else(zeros);
        let moments = NormalEquations::of_sums(&sums, self.frame.clone(), self.shift.clone());
        if !moments.in_range() {
            return Ok(None);
        }
        let rows = moments.frame.weighted_rows as f64;
        let all = || Sums {
            products: moments.gram.clone(),
            right: moments.right.clone(),
            squares: moments.squares.clone(),
            rows,
        };
        if sample.is_none() && !may_do(&all()) {
            return Ok(None);
        }
        let all_squares = moments.squares.clone();
        let Eigen {
            values: mut s,
            mut vt,
        } = f64::eigen(moments.gram.view())?;
        let (Some(&largest), Some(&smallest)) = (s.first(), s.last()) else {
            return Ok(None);
        };
        // With the correction c errors are as if the condition were (1 + c / s_1^2) times as large.
        let larger = 1.0 + moments.correction / largest;
        let conditioned = gram::allowed::<f64>(smallest / largest / larger);
        if !conditioned {
            // What ridge keeps of a direction is s^2 / (s^2 + l), so that an error of epsilon in the weakest
            // s^2 is one of epsilon / l in that; of those below epsilon all digits are lost.
            let known = s.iter().filter(|s| **s > f64::EPSILON * largest).count();
            s = s.slice(s![..known]).to_owned();
            vt = vt.slice(s![..known, ..]).to_owned();
        }
        let mut spectrum = moments.along(Eigen { values: s, vt });
        let share = spectrum.residual_ss.iter().zip(&all_squares);
        let share = share.filter(|(_, all)| **all > 0.0);
        let share = share.fold(1.0, |least: f64, (left, all)| least.min(left / all));
        if share < gram::UNEXPLAINED {
            return Ok(None);
        }
        spectrum.weakest = (!conditioned).then(|| gram::weakest_searched(share) * larger);
        Ok(Some(spectrum))
    }
}

impl<A: Scalar> NormalEquations<A> {
    /// The problem in the coordinates of its singular vectors: none where all is 0.
    ///
    /// # Errors
    /// Those of the factorization.
    pub(crate) fn spectrum(self) -> Result<DesignSvd<A>> {
        let Eigen { values, vt } = A::eigen(self.gram.view())?;
        let known = if values.first().is_some_and(|largest| *largest > A::zero()) {
            values.len()
        } else {
            0
        };
        let values = values.mapv_into(|value| value.max(A::zero()));
        let (values, vt) = (
            values.slice_move(s![..known]),
            vt.slice_move(s![..known, ..]),
        );
        Ok(self.along(Eigen { values, vt }))
    }

    /// The problem in the coordinates of these eigenvectors of the sums of products.
    fn along(self, Eigen { values, vt }: Eigen<A>) -> DesignSvd<A> {
        let Self {
            gram,
            right,
            squares: all,
            frame,
            ..
        } = self;
        let s = values.mapv_into(A::sqrt);
        let mut c = A::product(vt.view(), right.view());
        for (mut c, &s) in c.rows_mut().into_iter().zip(&s) {
            c.mapv_inplace(|c| if s > A::zero() { c / s } else { A::zero() });
        }
        let explained = c.map_axis(Axis(0), |column| column.dot(&column));
        let mean = &frame.hidden_mean / frame.hidden_scale;
        let column_ss = &gram.diag() + &mean.mapv_into(|m| m * m * frame.total_weight);
        DesignSvd {
            route: Route::GramSvd,
            s,
            vt,
            c,
            residual_ss: (all - explained).mapv_into(|left| left.max(A::zero())),
            column_ss,
            weakest: None,
            frame,
        }
    }
}
