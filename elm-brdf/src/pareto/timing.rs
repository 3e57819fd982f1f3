//! Measures the time per evaluation, with the models taking turns.

use std::any::Any;
use std::hint::black_box;
use std::time::Instant;

use crate::baselines::Nbrdf;
use crate::batch::{Batched, Columns, Packed, Precision, Real};
use crate::error::Result;
use crate::fit::Model;
use crate::statistics::median;
use elm_datasets::geometry::DirectionPair;

/// Pairs in a batch: its directions and values stay in the second-level cache.
const BATCH: usize = 4096;
/// Turns of each model.
const TURNS: usize = 31;
/// Seconds that a turn should take.
const TURN: f64 = 1e-3;

/// A model with its batch and room for the values.
enum Timed<'a> {
    Single(&'a dyn Batched<f32>, Columns<f32>, Vec<f32>),
    Double(&'a dyn Batched<f64>, Columns<f64>, Vec<f64>),
    General(&'a dyn Model, Vec<DirectionPair>),
}

/// The median time of an evaluation for each model, in nanoseconds.
pub(super) fn take_turns(models: &[Box<dyn Model>], pairs: &[DirectionPair]) -> Result<Vec<f64>> {
    let batch: Vec<DirectionPair> = pairs.iter().copied().cycle().take(BATCH).collect();
    // Of each the passes in a turn and the nanoseconds so far.
    let mut all = Vec::with_capacity(models.len());
    for model in models {
        let mut timed = Timed::new(model.as_ref(), &batch);
        timed.pass()?;
        let once = timed.seconds(1)?;
        if let Timed::General(_, pairs) = &mut timed {
            // A slow model has a smaller batch.
            let share = (5.0 * TURN / once.max(1e-9)).min(1.0);
            pairs.truncate(((pairs.len() as f64 * share) as usize).max(64));
        }
        let once = timed.seconds(1)?;
        let passes = ((TURN / once.max(1e-9)) as usize).clamp(1, 1000);
        all.push((timed, passes, Vec::with_capacity(TURNS)));
    }
    for _ in 0..TURNS {
        for (timed, passes, times) in &mut all {
            let evaluations = timed.rows() * *passes;
            times.push(timed.seconds(*passes)? / evaluations as f64 * 1e9);
        }
    }
    Ok(all
        .into_iter()
        .map(|(_, _, times)| median(times).unwrap_or(0.0))
        .collect())
}

/// The model for directions in columns, where it is packed for them.
fn by_columns(model: &dyn Model) -> Option<Precision<'_>> {
    let any: &dyn Any = model;
    if let Some(packed) = any.downcast_ref::<Packed<f32>>() {
        Some(Precision::Single(packed))
    } else if let Some(packed) = any.downcast_ref::<Packed<f64>>() {
        Some(Precision::Double(packed))
    } else {
        let other = any.downcast_ref::<Nbrdf>()?;
        Some(Precision::Single(other))
    }
}

impl<'a> Timed<'a> {
    fn new(model: &'a dyn Model, batch: &[DirectionPair]) -> Self {
        fn room<A: Real>(model: &dyn Batched<A>, batch: &[DirectionPair]) -> (Columns<A>, Vec<A>) {
            let values = vec![A::zero(); batch.len() * model.channels()];
            (Columns::new(batch), values)
        }
        match by_columns(model) {
            Some(Precision::Single(model)) => {
                let (columns, values) = room(model, batch);
                Self::Single(model, columns, values)
            }
            Some(Precision::Double(model)) => {
                let (columns, values) = room(model, batch);
                Self::Double(model, columns, values)
            }
            None => Self::General(model, batch.to_vec()),
        }
    }

    fn rows(&self) -> usize {
        match self {
            Self::Single(_, columns, _) => columns.len(),
            Self::Double(_, columns, _) => columns.len(),
            Self::General(_, pairs) => pairs.len(),
        }
    }

    fn pass(&mut self) -> Result<()> {
        match self {
            Self::Single(model, columns, values) => {
                model.eval_into(columns, values)?;
                black_box(values);
            }
            Self::Double(model, columns, values) => {
                model.eval_into(columns, values)?;
                black_box(values);
            }
            Self::General(model, pairs) => {
                black_box(model.eval(pairs)?);
            }
        }
        Ok(())
    }

    fn seconds(&mut self, passes: usize) -> Result<f64> {
        let start = Instant::now();
        for _ in 0..passes {
            self.pass()?;
        }
        Ok(start.elapsed().as_secs_f64())
    }
}
