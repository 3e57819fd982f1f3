//! This project's networks.

use elm::solve::Ridge;
use elm::{Activation, ElmParams};

use super::{CostClass, ModelEntry};
use crate::features::Features;
use crate::fit::boxed;
use crate::model::{BrdfParams, Tuned};
use crate::prior::PriorParams;
use crate::target_transform::TargetTransform;

/// Everything chosen by held-out errors, each material by itself.
const TUNED: &str = "elm (tuned)";
/// The same with a prior from the other materials.
pub const POOLED: &str = "elm (prior)";

fn tuned(name: &str, seed: u64) -> ModelEntry {
    ModelEntry {
        name: name.to_owned(),
        // Chosen for each material.
        features: None,
        transform: Some(TargetTransform::default_log()),
        cost: CostClass::Linear,
        network: true,
        method: boxed(Tuned {
            seed,
            ..Tuned::default()
        }),
    }
}

/// The paper's network, and the same idea with inputs, target and ridge that suit the task.
pub(super) fn networks(seed: u64) -> [ModelEntry; 4] {
    let entry = |name: &str, params: BrdfParams| ModelEntry {
        name: name.to_owned(),
        features: Some(params.features),
        transform: Some(params.transform),
        cost: CostClass::Linear,
        network: true,
        method: boxed(params),
    };
    [
        entry(
            "elm (paper)",
            // As 'reproduce' has it.
            BrdfParams::paper(50).seed(seed),
        ),
        entry(
            "elm (200 sine, ridge)",
            BrdfParams {
                features: Features::Cosines,
                transform: TargetTransform::default_log(),
                network: ElmParams::new(200)
                    .with_seed(seed)
                    .with_activation(Activation::Sine)
                    .with_solver(Ridge::leave_one_out()),
            },
        ),
        tuned(TUNED, seed),
        // What is fitted to count its numbers: a network without the prior, of as many neurons.
        ModelEntry {
            features: Some(Features::SumDifference),
            method: boxed(Tuned {
                features: Some(Features::SumDifference),
                neurons: Some(PriorParams::default().neurons),
                seed,
                ..Tuned::default()
            }),
            ..tuned(POOLED, seed)
        },
    ]
}
