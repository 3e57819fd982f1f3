//! Solvers in files: where people read it, the name alone stands for the default settings.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};

use super::{Inverse, PseudoInverse, Ridge, Solver};

/// What is derived from the names of the variants.
#[derive(serde::Deserialize)]
#[serde(rename = "Solver", rename_all = "kebab-case")]
enum Tagged {
    Inverse(Inverse),
    PseudoInverse(PseudoInverse),
    Ridge(Ridge),
}

impl From<Tagged> for Solver {
    fn from(tagged: Tagged) -> Self {
        match tagged {
            Tagged::Inverse(solver) => solver.into(),
            Tagged::PseudoInverse(solver) => solver.into(),
            Tagged::Ridge(solver) => solver.into(),
        }
    }
}

struct NameOrSettings;

impl<'de> Visitor<'de> for NameOrSettings {
    type Value = Solver;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a solver: one of {}, or one with its settings",
            Solver::NAMES
        )
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<Solver, E> {
        name.parse().map_err(E::custom)
    }

    fn visit_map<M: MapAccess<'de>>(self, map: M) -> Result<Solver, M::Error> {
        Tagged::deserialize(MapAccessDeserializer::new(map)).map(Solver::from)
    }
}

impl<'de> Deserialize<'de> for Solver {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            deserializer.deserialize_any(NameOrSettings)
        } else {
            Tagged::deserialize(deserializer).map(Self::from)
        }
    }
}
