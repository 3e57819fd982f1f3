//! Interpolation by radial basis functions with a polynomial.

use elm_datasets::brdf::EvalError;
use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use super::inputs::{Frame, join_duplicates, squared_distances};
use super::kernel::{Projected, Weights, check_rows};
use crate::error::Result;
use crate::features::Features;
use crate::fit::{Fit, Model, assign};
use crate::target_transform::TargetTransform;
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// A radial basis function of the distance $r$.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Radial {
    /// $r^2 \ln r$.
    ThinPlate,
    /// $r^3$.
    Cubic,
    /// $-r$, which needs no more than a constant beside it.
    Linear,
}

impl Radial {
    fn of_squared(self, squared: f64) -> f64 {
        match self {
            // Without a distance there is none of it; ln 0 is not asked for.
            Self::ThinPlate if squared == 0.0 => 0.0,
            Self::ThinPlate => 0.5 * squared * squared.ln(),
            Self::Cubic => squared * squared.sqrt(),
            Self::Linear => -squared.sqrt(),
        }
    }
}

/// How closely the data are met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Smoothing {
    /// Exactly (the mean where several measurements lie at one point).
    Exact,
    /// As closely as leaves the smallest leave-one-out error in the target, per channel.
    LeaveOneOut,
}

/// $s(x) = \sum_i \alpha_i \varphi(|x - x_i|) + c_0 + c^T x$ over standardised inputs, with the
/// polynomial reproduced exactly.
///
/// [`Radial::Linear`] has a constant alone for its polynomial, and takes the place of the others
/// where there are fewer than twice as many measurements as terms of theirs.
///
/// J. Duchon, *Splines Minimizing Rotation-Invariant Semi-Norms in Sobolev Spaces*, 1977;
/// H. Wendland, *Scattered Data Approximation*, 2005, chapter 8.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialBasis {
    /// Inputs.
    pub features: Features,
    /// Target.
    pub transform: TargetTransform,
    /// Basis function.
    pub radial: Radial,
    /// Regularisation.
    pub smoothing: Smoothing,
}

/// A fitted [`RadialBasis`].
pub struct RadialBasisModel {
    frame: Frame,
    radial: Radial,
    nodes: Array2<f64>,
    weights: Weights,
}

/// Strengths tried, relative to the largest eigenvalue: two to a decade.
fn candidates() -> impl Iterator<Item = f64> {
    (-20..=0).map(|step| 10.0_f64.powf(f64::from(step) / 2.0))
}

/// 1, and the inputs where there are `terms` for them.
fn polynomial(x: &Array2<f64>, terms: usize) -> Array2<f64> {
    Array2::from_shape_fn((x.nrows(), terms), |(row, term)| match term {
        0 => 1.0,
        _ => x[[row, term - 1]],
    })
}

impl Fit for RadialBasis {
    type Model = RadialBasisModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        let (frame, x, targets) = Frame::fit(self.features, self.transform, pairs, values)?;
        let (nodes, targets) = match self.smoothing {
            Smoothing::Exact => join_duplicates(&x, &targets),
            Smoothing::LeaveOneOut => (x, targets),
        };
        check_rows("radial basis functions", nodes.nrows())?;
        let linear = frame.inputs() + 1;
        let (radial, terms) = match self.radial {
            Radial::ThinPlate | Radial::Cubic if nodes.nrows() >= 2 * linear => {
                (self.radial, linear)
            }
            _ => (Radial::Linear, 1),
        };
        let kernel = squared_distances(&nodes, &nodes).mapv(|d| radial.of_squared(d));
        let projected = Projected::new(kernel.clone(), polynomial(&nodes, terms).view())?;
        let lambda = match self.smoothing {
            Smoothing::Exact => vec![0.0; targets.ncols()],
            Smoothing::LeaveOneOut => leave_one_out(&projected, targets.view()),
        };
        Ok(RadialBasisModel {
            weights: projected.weights(kernel.view(), targets.view(), &lambda),
            frame,
            radial,
            nodes,
        })
    }
}

/// The best strength of each column.
fn leave_one_out(projected: &Projected, targets: ArrayView2<'_, f64>) -> Vec<f64> {
    let (squared, coordinates) = (projected.squared(), projected.coordinates(targets));
    let mut best = vec![(f64::INFINITY, 0.0); targets.ncols()];
    for candidate in candidates() {
        let lambda = candidate * projected.largest();
        let errors = projected.leave_one_out(squared.view(), coordinates.view(), lambda);
        for (best, errors) in best.iter_mut().zip(errors.columns()) {
            let error = errors.dot(&errors);
            // Of equals the strongest.
            if error <= best.0 {
                *best = (error, lambda);
            }
        }
    }
    best.into_iter().map(|(_, lambda)| lambda).collect()
}

impl RadialBasisModel {
    fn values_at(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        let x = self.frame.points(pairs)?;
        let kernel = squared_distances(&x, &self.nodes).mapv(|d| self.radial.of_squared(d));
        let tail = polynomial(&x, self.weights.tail.nrows()).dot(&self.weights.tail);
        self.frame
            .values(pairs, kernel.dot(&self.weights.kernel) + tail)
    }
}

impl Brdf for RadialBasisModel {
    fn channels(&self) -> usize {
        self.frame.channels()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        assign(self.values_at(pairs)?, values)
    }
}

impl Model for RadialBasisModel {
    fn floats_per_channel(&self) -> usize {
        self.nodes.len()
            + self.weights.kernel.nrows()
            + self.weights.tail.nrows()
            + self.frame.floats_per_channel()
    }
}
