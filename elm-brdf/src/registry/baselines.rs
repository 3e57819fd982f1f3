//! Other people's models, with the inputs and targets that they are compared on.

use elm::solve::Ridge;

use super::{CostClass, ModelEntry};
use crate::baselines::{
    Analytic, GaussianProcess, Koenderink, Neighbors, Radial, RadialBasis, Smoothing,
};
use crate::features::Features;
use crate::fit::{AnyFit, boxed};
use crate::target_transform::TargetTransform;

/// Every baseline: the analytic models, Koenderink's basis, and the interpolators on the paper's
/// inputs and target, on the inputs and target that suit them best, and, for those that gain by
/// it, on reciprocal inputs.
#[must_use]
pub fn baselines() -> Vec<ModelEntry> {
    with_candidates(GaussianProcess::CANDIDATES)
}

/// The same with `candidates` length scales to choose from for Gaussian processes.
pub(crate) fn with_candidates(candidates: usize) -> Vec<ModelEntry> {
    let mut all: Vec<ModelEntry> = Analytic::ALL
        .into_iter()
        .map(|model| ModelEntry {
            name: model.name().to_owned(),
            features: None,
            transform: None,
            cost: CostClass::Grid,
            network: false,
            method: boxed(model),
        })
        .collect();
    all.extend([2, 8].map(|order| ModelEntry {
        name: format!("koenderink-{order}"),
        features: None,
        transform: None,
        cost: CostClass::Linear,
        network: false,
        // Order 8 overfits without: 55 coefficients, some 185 measurements.
        method: boxed(Koenderink {
            order,
            solver: Ridge::leave_one_out().into(),
        }),
    }));
    for (features, transform) in [
        (Features::Paper, TargetTransform::Identity),
        (Features::Paper, TargetTransform::default_log()),
        (Features::Cosines, TargetTransform::default_log()),
        (Features::ReciprocalCosines, TargetTransform::default_log()),
    ] {
        all.extend(interpolators(features, transform, candidates));
    }
    all
}

fn interpolators(
    features: Features,
    transform: TargetTransform,
    candidates: usize,
) -> Vec<ModelEntry> {
    let neighbors = |count| -> Box<AnyFit> {
        boxed(Neighbors {
            features,
            transform,
            count,
        })
    };
    let radial = |radial, smoothing| -> Box<AnyFit> {
        boxed(RadialBasis {
            features,
            transform,
            radial,
            smoothing,
        })
    };
    use CostClass::{Cubic, Linear, ManyCubic};
    use Smoothing::{Exact, LeaveOneOut};
    let methods = [
        ("nearest", Linear, neighbors(1)),
        ("inverse-distance-5", Linear, neighbors(5)),
        ("inverse-distance-all", Linear, neighbors(usize::MAX)),
        ("thin-plate", Cubic, radial(Radial::ThinPlate, Exact)),
        (
            "thin-plate-smoothed",
            Cubic,
            radial(Radial::ThinPlate, LeaveOneOut),
        ),
        ("cubic", Cubic, radial(Radial::Cubic, Exact)),
        ("cubic-smoothed", Cubic, radial(Radial::Cubic, LeaveOneOut)),
        (
            "gaussian-process",
            ManyCubic,
            boxed(GaussianProcess {
                candidates,
                ..GaussianProcess::new(features, transform)
            }),
        ),
    ];
    methods
        .into_iter()
        .map(|(name, cost, method)| ModelEntry {
            name: name.to_owned(),
            features: Some(features),
            transform: Some(transform),
            cost,
            network: false,
            method,
        })
        .collect()
}
