//! Models by the names that were typed.

use elm_datasets::{Invalid, Measurements};

use super::Failure;
use super::common::usage;
use super::data::Source;
use crate::error::Error;
use crate::prior::PriorParams;
use crate::protocol::{Folds, MaterialScores, cross_validate_pooled};
use crate::registry::{self, ModelEntry};

/// Each material of `data` with a prior from all others that its source has.
pub(super) fn cross_validate_with_prior(
    source: &Source,
    data: &Measurements,
    invalid: Invalid,
    seed: u64,
    folds: &Folds,
    done: impl Fn(usize, usize) + Sync,
) -> Result<Vec<MaterialScores>, Failure> {
    let pool = source.load(&source.select("all")?, invalid)?;
    let params = PriorParams {
        seed,
        ..PriorParams::default()
    };
    Ok(cross_validate_pooled(&params, &pool, data, folds, done)?)
}

/// The model of this name, or of this name with its inputs and target in brackets.
pub(super) fn named(name: &str, seed: u64) -> Result<ModelEntry, Failure> {
    let mut found = registry::all(seed);
    found.retain(|model| model.name == name || model.full_name() == name);
    match found.len() {
        1 => Ok(found.swap_remove(0)),
        0 => {
            let known: Vec<String> = registry::all(seed)
                .iter()
                .map(ModelEntry::full_name)
                .collect();
            Err(usage(Error::UnknownName {
                what: "model",
                name: name.to_owned(),
                expected: format!("paper, best, {}", known.join(", ")),
            }))
        }
        count => {
            let found: Vec<String> = found.iter().map(ModelEntry::full_name).collect();
            Err(usage(format_args!(
                "model '{name}' is {count}, expected one of: {}",
                found.join(", ")
            )))
        }
    }
}

/// The models of these names. A name with inputs and target in brackets, as tables print it, is
/// one model; a name alone is that model on every set of inputs and targets that it comes with.
pub(super) fn select(list: &str, seed: u64) -> Result<Vec<ModelEntry>, Failure> {
    let mut models = registry::all(seed);
    if list.trim() == "all" {
        return Ok(models);
    }
    let names = outside_brackets(list);
    let is = |model: &ModelEntry, name: &str| model.name == name || model.full_name() == name;
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
