//! Lists every model that the project can fit, for the comparison of run time with error.

use elm::Activation;

use super::baselines;
use crate::fit::{AnyFit, boxed};
use crate::metrics::Metric;
use crate::model::{BrdfParams, Compact, Tuned};
use crate::recipes::Joint;

/// A way to fit a model, with its name.
pub struct Candidate {
    /// The name.
    pub name: String,
    /// The way.
    pub method: Box<AnyFit>,
}

/// Sizes of networks.
const NEURONS: [usize; 8] = [16, 24, 32, 40, 48, 64, 80, 128];

/// Networks by size, function, and pruned or not; the paper's; the tuned one; and every baseline.
#[must_use]
pub fn candidates(metric: Metric, seed: u64) -> Vec<Candidate> {
    let mut all = Vec::new();
    for activation in [
        Activation::Relu,
        Activation::SquaredRelu,
        Activation::Isru,
        Activation::Sine,
    ] {
        for neurons in NEURONS {
            for pruned in [false, true] {
                let kind = if pruned { "pruned" } else { "drawn" };
                all.push(Candidate {
                    name: format!("elm {activation} {neurons} {kind}"),
                    method: boxed(Compact {
                        activation: activation.clone(),
                        pruned,
                        metric,
                        seed,
                        ..Compact::new(neurons)
                    }),
                });
            }
        }
    }
    all.push(Candidate {
        name: "elm (paper)".to_owned(),
        method: boxed(BrdfParams::paper(50).seed(seed)),
    });
    let tuned = Tuned {
        metric,
        seed,
        ..Tuned::default()
    };
    all.push(Candidate {
        name: "elm (tuned)".to_owned(),
        method: boxed(Joint(tuned)),
    });
    all.extend(baselines().into_iter().map(|baseline| {
        let baseline = baseline.with_row_limit(seed);
        Candidate {
            name: baseline.full_name(),
            method: baseline.method,
        }
    }));
    all
}
