//! Networks small enough for tests.

use std::path::PathBuf;

use elm::{Activation, ElmParams, solve::Ridge};
use elm_brdf::features::Features;
use elm_brdf::fit::boxed;
use elm_brdf::model::BrdfParams;
use elm_brdf::scene_materials::SceneMaterialLoader;
use elm_brdf::target_transform::TargetTransform;

/// Fitted to CUReT's files in this folder, or to the synthetic data.
pub(crate) fn library(curet: Option<PathBuf>) -> SceneMaterialLoader {
    SceneMaterialLoader::with_network(
        curet,
        Box::new(|_| {
            boxed(BrdfParams {
                features: Features::ReciprocalCosines,
                transform: TargetTransform::default_log(),
                network: ElmParams::new(40)
                    .with_activation(Activation::Tanh)
                    .with_solver(Ridge::leave_one_out()),
            })
        }),
    )
}
