//! The models that commands know by name.

use elm::solve::Ridge;
use elm::{Activation, ElmParams};
use elm_datasets::{Invalid, Measurements};

use super::Failure;
use super::common::usage;
use super::data::Source;
use crate::error::Error;
use crate::features::Features;
use crate::fit::boxed;
use crate::link::Link;
use crate::model::{BrdfParams, Tuned};
use crate::prior::PriorParams;
use crate::protocol::{Folds, MaterialScores, cross_validate_pooled};
use crate::reference::{self, Growth, Reference};

/// Everything chosen by held-out errors, each material by itself.
const TUNED: &str = "elm (tuned)";
/// The same with a prior from the other materials.
pub(super) const POOLED: &str = "elm (prior)";

fn tuned(name: &str, seed: u64) -> Reference {
    Reference {
        name: name.to_owned(),
        // Chosen for each material.
        features: None,
        link: Some(Link::default_log()),
        growth: Growth::Linear,
        network: true,
        method: boxed(Tuned {
            seed,
            ..Tuned::default()
        }),
    }
}

/// Each material of `data` with a prior from all others that its source has.
pub(super) fn cross_validate_with_prior(
    source: &Source,
    data: &Measurements,
    invalid: Invalid,
    seed: u64,
    folds: &Folds,
    done: impl FnMut(usize, usize),
) -> Result<Vec<MaterialScores>, Failure> {
    let pool = source.load(&source.select("all")?, invalid)?;
    let params = PriorParams {
        seed,
        ..PriorParams::default()
    };
    Ok(cross_validate_pooled(&params, &pool, data, folds, done)?)
}

fn all(seed: u64) -> Vec<Reference> {
    reference::all().into_iter().chain(networks(seed)).collect()
}

/// The model of this name, or of this name with its inputs and target in brackets.
pub(super) fn named(name: &str, seed: u64) -> Result<Reference, Failure> {
    let mut found = all(seed);
    found.retain(|model| model.name == name || model.full_name() == name);
    match found.len() {
        1 => Ok(found.swap_remove(0)),
        0 => {
            let known: Vec<String> = all(seed).iter().map(Reference::full_name).collect();
            Err(usage(Error::UnknownName {
                what: "model",
                name: name.to_owned(),
                expected: format!("paper, best, {}", known.join(", ")),
            }))
        }
        count => {
            let found: Vec<String> = found.iter().map(Reference::full_name).collect();
            Err(usage(format_args!(
                "model '{name}' is {count}, expected one of: {}",
                found.join(", ")
            )))
        }
    }
}

/// The models of these names. A name with inputs and target in brackets, as tables print it, is
/// one model; a name alone is that model on every set of inputs and targets that it comes with.
pub(super) fn select(list: &str, seed: u64) -> Result<Vec<Reference>, Failure> {
    let mut models = all(seed);
    if list.trim() == "all" {
        return Ok(models);
    }
    let names = outside_brackets(list);
    let is = |model: &Reference, name: &str| model.name == name || model.full_name() == name;
    if let Some(&unknown) = names
        .iter()
        .find(|&&name| !models.iter().any(|model| is(model, name)))
    {
        let mut known: Vec<String> = models.into_iter().map(|model| model.name).collect();
        known.sort_unstable();
        known.dedup();
        return Err(usage(Error::UnknownName {
            what: "model",
            name: unknown.to_owned(),
            expected: known.join(", "),
        }));
    }
    models.retain(|model| names.iter().any(|name| is(model, name)));
    Ok(models)
}

/// The parts of a list between commas that are not in brackets, as some names have them.
fn outside_brackets(list: &str) -> Vec<&str> {
    let mut depth = 0_usize;
    let parts = list.split(|c: char| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        c == ',' && depth == 0
    });
    parts.map(str::trim).collect()
}

/// The paper's network, and the same idea with inputs, target and ridge that suit the task.
fn networks(seed: u64) -> [Reference; 4] {
    let reference = |name: &str, params: BrdfParams| Reference {
        name: name.to_owned(),
        features: Some(params.features),
        link: Some(params.link),
        growth: Growth::Linear,
        network: true,
        method: boxed(params),
    };
    [
        reference(
            "elm (paper)",
            // As 'reproduce' has it.
            BrdfParams::paper(50).seed(seed),
        ),
        reference(
            "elm (200 sine, ridge)",
            BrdfParams {
                features: Features::Cosines,
                link: Link::default_log(),
                network: ElmParams::new(200)
                    .with_seed(seed)
                    .with_activation(Activation::Sine)
                    .with_solver(Ridge::leave_one_out()),
            },
        ),
        tuned(TUNED, seed),
        // What is fitted to count its numbers: a network without the prior, of as many neurons.
        Reference {
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
