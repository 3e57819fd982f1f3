//! Gathers evaluations from many paths and carries them out by material.

use std::time::Instant;

use crate::error::Result;
use crate::material_cache::MaterialCache;
use crate::stats::{Optimizations, Reason, TileStats};
use crate::vector::{BLACK, Rgb};
use elm_datasets::geometry::DirectionPair;

/// One evaluation that a path waits for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EvalRequest {
    pub(crate) material: usize,
    pub(crate) pair: DirectionPair,
    /// Index of the path.
    pub(crate) path: usize,
    /// The light, or [`SCATTERED`].
    pub(crate) light: usize,
    /// Factor on the value.
    pub(crate) weight: Rgb,
    /// Whether the value counts; brute force evaluates also what does not.
    pub(crate) counts: bool,
}

/// Stands for a drawn direction instead of a light.
pub(crate) const SCATTERED: usize = usize::MAX;

/// Requests up to this many are gathered: enough to fill the evaluator's tiles, and a few
/// megabytes.
pub(crate) const CAPACITY: usize = 16_384;

/// Gathered requests and their values.
#[derive(Default)]
pub(crate) struct ShadingQueue {
    pub(crate) requests: Vec<EvalRequest>,
    /// One per request, once evaluated.
    pub(crate) values: Vec<Rgb>,
    order: Vec<usize>,
    pairs: Vec<DirectionPair>,
    /// For each request in order, the pair that stands for it.
    pair_of: Vec<usize>,
    /// For the evaluation of a material.
    room: Vec<f64>,
    found: Vec<Rgb>,
}

impl ShadingQueue {
    pub(crate) fn clear(&mut self) {
        self.requests.clear();
        self.values.clear();
    }

    /// Fills [`values`](Self::values), material by material.
    pub(crate) fn evaluate(
        &mut self,
        cache: &MaterialCache<'_>,
        savings: Optimizations,
        tally: &mut TileStats,
    ) -> Result<()> {
        let Self {
            requests,
            values,
            order,
            pairs,
            pair_of,
            room,
            found,
        } = self;
        values.clear();
        values.resize(requests.len(), BLACK);
        order.clear();
        order.extend(0..requests.len());
        // A stable sort: equal pairs are neighbours where a light and a view are the same.
        let material_of = |at: usize| requests[at].material;
        order.sort_by_key(|&at| (material_of(at), requests[at].light));
        for group in order.chunk_by(|&a, &b| material_of(a) == material_of(b)) {
            let index = material_of(group[0]);
            let material = cache.get(index)?;
            let start = Instant::now();
            pairs.clear();
            pair_of.clear();
            for &at in group {
                let pair = requests[at].pair;
                if !(savings.repeated && pairs.last() == Some(&pair)) {
                    pairs.push(pair);
                }
                pair_of.push(pairs.len() - 1);
            }
            material.eval_into(pairs, room, found)?;
            // Without colour each channel is the same network again.
            let times = if material.channels() == 1 { 3 } else { 1 };
            let done = pairs.len() as u64;
            tally.skip(Reason::Repeated, index, group.len() as u64 - done);
            tally.evaluations[index] += done;
            if savings.channels {
                tally.skip(Reason::OneChannel, index, (times - 1) * done);
            } else {
                for _ in 1..times {
                    // Brute force, and the same again.
                    material.eval_into(pairs, room, std::hint::black_box(found))?;
                    tally.evaluations[index] += done;
                }
            }
            for (&at, &pair) in group.iter().zip(pair_of.iter()) {
                values[at] = found[pair];
            }
            tally.evaluation_seconds += start.elapsed().as_secs_f64();
        }
        Ok(())
    }
}
