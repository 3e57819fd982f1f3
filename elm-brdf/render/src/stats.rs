//! Counts the work that a render did and the work that it skipped, by reason.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Work that a renderer may leave out; each can be switched off.
///
/// Those of [`LOSSLESS`](Self::LOSSLESS) leave the picture the same bit for bit; the others stay within a
/// bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Optimizations {
    /// Load and train only materials that some ray meets, when it first does.
    pub materials: bool,
    /// Evaluate a material without colour once, not once for each channel.
    pub channels: bool,
    /// Evaluate nothing below either horizon or in shadow.
    pub directions: bool,
    /// Evaluate once where neighbouring samples have the same pair of directions.
    pub repeated: bool,
    /// Leave out lights that together cannot change a sample by half a display step.
    pub dim_lights: bool,
    /// Stop where more samples would not change a pixel visibly.
    pub samples: bool,
}

impl Optimizations {
    /// Everything.
    pub const ALL: Self = Self {
        materials: true,
        channels: true,
        directions: true,
        repeated: true,
        dim_lights: true,
        samples: true,
    };
    /// Those that leave the picture the same bit for bit.
    pub const LOSSLESS: Self = Self {
        dim_lights: false,
        samples: false,
        ..Self::ALL
    };
    /// Brute force.
    pub const NONE: Self = Self {
        materials: false,
        channels: false,
        directions: false,
        repeated: false,
        ..Self::LOSSLESS
    };
    /// Their names, as [`without`](Self::without) reads them.
    pub const NAMES: [&str; 6] = [
        "materials",
        "channels",
        "directions",
        "repeated",
        "dim-lights",
        "samples",
    ];

    /// The same without one of them; `None` for a name that is none of [`NAMES`](Self::NAMES).
    #[must_use]
    pub fn without(mut self, name: &str) -> Option<Self> {
        let flag = match name {
            "materials" => &mut self.materials,
            "channels" => &mut self.channels,
            "directions" => &mut self.directions,
            "repeated" => &mut self.repeated,
            "dim-lights" => &mut self.dim_lights,
            "samples" => &mut self.samples,
            _ => return None,
        };
        *flag = false;
        Some(self)
    }
}

/// An amount of work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct EvalCost {
    /// Evaluations of a model at a pair of directions.
    pub evaluations: u64,
    /// Multiplications and additions in their matrix products.
    pub multiply_adds: u64,
    /// Seconds, summed over threads; for work left out, at the rate of the work done.
    pub seconds: f64,
}

/// What was done and what was left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RenderStats {
    /// Evaluations done.
    pub done: EvalCost,
    /// Evaluations left out, by reason. Those of stopped samples are counted at the rate of the
    /// samples before.
    pub skipped: BTreeMap<String, EvalCost>,
    /// Materials that the scene defines.
    pub materials_defined: usize,
    /// Those that were loaded or trained, with their evaluations.
    pub materials_used: BTreeMap<String, u64>,
    /// Camera samples taken.
    pub samples: u64,
    /// Camera samples left out.
    pub samples_skipped: u64,
    /// Rays, those for shadows included.
    pub rays: u64,
    /// Wall-clock and thread seconds by kind of work.
    pub seconds: Seconds,
    /// Which savings were on.
    pub savings: Option<Optimizations>,
    /// Worker threads.
    pub threads: usize,
    /// What should be known of the materials, such as an albedo above 1.
    pub notes: Vec<String>,
}

impl RenderStats {
    /// Adds the work of a sheet's panel, whose materials are its own.
    pub(crate) fn merge(&mut self, other: &Self, panel: usize) {
        self.done.add(other.done);
        for (reason, work) in &other.skipped {
            self.skipped.entry(reason.clone()).or_default().add(*work);
        }
        self.materials_defined += other.materials_defined;
        for (name, count) in &other.materials_used {
            self.materials_used
                .insert(format!("panel {panel}: {name}"), *count);
        }
        self.samples += other.samples;
        self.samples_skipped += other.samples_skipped;
        self.rays += other.rays;
        self.seconds.total += other.seconds.total;
        self.seconds.materials += other.seconds.materials;
        self.seconds.evaluation += other.seconds.evaluation;
        self.seconds.tracing += other.seconds.tracing;
        self.savings = self.savings.or(other.savings);
        self.threads = self.threads.max(other.threads);
        for note in &other.notes {
            if !self.notes.contains(note) {
                self.notes.push(note.clone());
            }
        }
    }
}

impl EvalCost {
    fn add(&mut self, other: Self) {
        self.evaluations += other.evaluations;
        self.multiply_adds += other.multiply_adds;
        self.seconds += other.seconds;
    }
}

/// Where time went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// Wall clock, all together.
    pub total: f64,
    /// Loading and training materials, summed over threads.
    pub materials: f64,
    /// Evaluating them, summed over threads.
    pub evaluation: f64,
    /// Everything else in the tiles, summed over threads.
    pub tracing: f64,
}

/// Why an evaluation was left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reason {
    BelowHorizon,
    InShadow,
    NoLight,
    OneChannel,
    Repeated,
    DimLight,
    Converged,
}

impl Reason {
    const ALL: [(Self, &'static str); 7] = [
        (Self::BelowHorizon, "below the horizon"),
        (Self::InShadow, "in shadow"),
        (Self::NoLight, "towards no light"),
        (Self::OneChannel, "channels alike"),
        (Self::Repeated, "repeated"),
        (Self::DimLight, "light too dim"),
        (Self::Converged, "pixel converged"),
    ];
}

/// Counts of one tile; merging does not depend on the order.
#[derive(Debug, Clone, Default)]
pub(crate) struct TileStats {
    /// Evaluations by material.
    pub(crate) evaluations: Vec<u64>,
    /// Evaluations left out by [`Reason`] and material.
    skipped: [Vec<u64>; Reason::ALL.len()],
    pub(crate) samples: u64,
    pub(crate) samples_skipped: u64,
    pub(crate) rays: u64,
    pub(crate) evaluation_seconds: f64,
    pub(crate) tile_seconds: f64,
}

impl TileStats {
    pub(crate) fn new(materials: usize) -> Self {
        Self {
            evaluations: vec![0; materials],
            skipped: std::array::from_fn(|_| vec![0; materials]),
            ..Self::default()
        }
    }

    pub(crate) fn skip(&mut self, reason: Reason, material: usize, evaluations: u64) {
        self.skipped[reason as usize][material] += evaluations;
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        let add = |to: &mut Vec<u64>, from: &[u64]| {
            to.iter_mut().zip(from).for_each(|(sum, term)| *sum += term);
        };
        add(&mut self.evaluations, &other.evaluations);
        for (to, from) in self.skipped.iter_mut().zip(&other.skipped) {
            add(to, from);
        }
        self.samples += other.samples;
        self.samples_skipped += other.samples_skipped;
        self.rays += other.rays;
        self.evaluation_seconds += other.evaluation_seconds;
        self.tile_seconds += other.tile_seconds;
    }

    /// The account, given the names of the materials and the cost of one evaluation of each that
    /// was loaded.
    pub(crate) fn account(&self, materials: &[(&str, Option<usize>)]) -> RenderStats {
        let cost = |counts: &[u64]| -> u64 {
            let costs = materials.iter().map(|(_, cost)| cost.unwrap_or(0) as u64);
            counts
                .iter()
                .zip(costs)
                .map(|(count, cost)| count * cost)
                .sum()
        };
        let done: u64 = self.evaluations.iter().sum();
        let rate = if done > 0 {
            self.evaluation_seconds / done as f64
        } else {
            0.0
        };
        let work = |counts: &[u64]| -> EvalCost {
            let evaluations = counts.iter().sum();
            EvalCost {
                evaluations,
                multiply_adds: cost(counts),
                seconds: evaluations as f64 * rate,
            }
        };
        RenderStats {
            done: work(&self.evaluations),
            skipped: Reason::ALL
                .into_iter()
                .map(|(reason, name)| (name.to_owned(), work(&self.skipped[reason as usize])))
                .filter(|(_, work)| work.evaluations > 0)
                .collect(),
            materials_defined: materials.len(),
            materials_used: materials
                .iter()
                .zip(&self.evaluations)
                .filter(|((_, cost), _)| cost.is_some())
                .map(|((name, _), &count)| ((*name).to_owned(), count))
                .collect(),
            samples: self.samples,
            samples_skipped: self.samples_skipped,
            rays: self.rays,
            seconds: Seconds {
                evaluation: self.evaluation_seconds,
                tracing: self.tile_seconds - self.evaluation_seconds,
                ..Seconds::default()
            },
            ..RenderStats::default()
        }
    }
}

impl std::fmt::Display for RenderStats {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let used = self.materials_used.len();
        writeln!(
            f,
            "materials   {used} of {} loaded, {:.2} s",
            self.materials_defined, self.seconds.materials
        )?;
        writeln!(
            f,
            "samples     {} taken, {} left out",
            self.samples, self.samples_skipped
        )?;
        writeln!(f, "rays        {}", self.rays)?;
        let line = |f: &mut std::fmt::Formatter<'_>, name: &str, work: &EvalCost| {
            let EvalCost {
                evaluations,
                multiply_adds,
                seconds,
            } = work;
            writeln!(
                f,
                "  {name:<18} {evaluations:>13} {multiply_adds:>17} {seconds:>10.3}"
            )
        };
        writeln!(
            f,
            "evaluations {:>21} {:>17} {:>10}",
            "number", "multiply-adds", "seconds"
        )?;
        line(f, "done", &self.done)?;
        for (reason, work) in &self.skipped {
            line(f, reason, work)?;
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        let Seconds {
            total,
            evaluation,
            tracing,
            ..
        } = self.seconds;
        writeln!(
            f,
            "seconds     {total:.2} wall clock on {} threads; {evaluation:.2} evaluating, \
             {tracing:.2} tracing, summed over threads",
            self.threads
        )
    }
}
