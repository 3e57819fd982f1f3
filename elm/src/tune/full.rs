//! The search of [`Level::Full`](super::Level): with ramps or without, and how many rounds of the
//! learned [metric](super::metric).

use ndarray::{Array1, Array2, Axis};
use rand::seq::SliceRandom;

use super::attempt::surely_smaller;
use super::metric::{Path, ROUNDS, Round, Seen, layer, wide};
use super::rows::{chosen_rows, deviation};
use super::{Trial, Tuner};
use crate::dataset::{Dataset, TargetDim};
use crate::error::Result;
use crate::feature_map::{Embedding, Ramps};
use crate::model::ElmParams;
use crate::scalar::Scalar;
use crate::stats::Moments;
use crate::stream::Stream;
use crate::threads;

/// Rows under which the quick search is as good, and takes less time.
pub(super) const FEWEST_ROWS: usize = 300;
/// Neurons of a layer of the search.
const NEURONS: (usize, usize) = (50, 200);
/// Ramps of an input at most, and of all inputs together.
const BINS: usize = 16;
const COLUMNS: usize = 600;
/// Rows up to which every row is held out once, in turn; of more, a quarter is.
pub(super) const FEW_ROWS: usize = 1500;
const FOLDS: usize = 3;
/// Layers that are solved at most; a path has some 20.
const MAX_LAYERS: usize = 500;
/// What any other candidate must win by over ramps and one round of slopes, which do well on most tables.
const MARGIN: f64 = 0.005;
/// A held-out error, relative to the targets' deviation, that sums of squares cannot tell from 0.
const ROUNDING: f64 = 1e-5;

/// What the full search found.
pub(super) struct Choice<A: Scalar> {
    pub(super) params: ElmParams<A>,
    pub(super) best: Trial,
    pub(super) trials: Vec<Trial>,
}

/// A number of rounds, with ramps or without, and its squared errors at the rows held out.
struct Candidate {
    ramps: bool,
    round: usize,
    /// The mean of these, of an output.
    error: f64,
    squares: Vec<f64>,
}

impl Candidate {
    /// Of ramps and one round of slopes, or the first where there is no such, unless another is surely
    /// better: by more than the standard error of the mean difference, row by row.
    fn best(candidates: Vec<Self>) -> Option<Self> {
        let usual = |candidate: &Self| candidate.ramps && candidate.round == 1;
        let usual = candidates.iter().position(usual).unwrap_or(0);
        let known = &candidates.get(usual)?.squares;
        let mut best = usual;
        for (place, candidate) in candidates.iter().enumerate() {
            let wins = candidate.error < candidates[best].error * (1.0 - MARGIN);
            if wins && surely_smaller(&candidate.squares, known, 1.0) {
                best = place;
            }
        }
        candidates.into_iter().nth(best)
    }
}

/// Nothing where errors are so small that the exact search is to decide.
pub(super) fn search<A: Scalar, D: TargetDim>(
    tuner: &Tuner<A>,
    data: &Dataset<'_, A, D>,
) -> Result<Option<Choice<A>>> {
    let chosen = chosen_rows(tuner, data);
    let rows = chosen.unwrap_or_else(|| (0..data.rows()).collect());
    let x = wide(data.inputs().select(Axis(0), &rows).view());
    let weights = data
        .weights()
        .map(|weights| weights.select(Axis(0), &rows).mapv(Scalar::as_f64));
    let mut targets = wide(data.target_matrix().select(Axis(0), &rows).view());
    for mut column in targets.columns_mut() {
        let view = weights.as_ref().map(|weights| weights.view());
        let spread = deviation(column.view(), view);
        let moments = Moments::of(column.view().insert_axis(Axis(1)), view);
        let mean = moments.columns()[0].mean();
        column.mapv_inplace(|t| (t - mean) / spread);
    }
    let neurons = (rows.len() / 3).clamp(NEURONS.0, NEURONS.1);
    let seed = tuner.seed();
    let mut search = FullSearch {
        plain: Seen::new(x.clone(), targets.clone(), weights.clone(), None, seed)
            .with_bounded(tuner.base.bounded()),
        embedded: Seen::new(x.clone(), targets, weights, Some(bins(&x)), seed)
            .with_bounded(tuner.base.bounded()),
        neurons,
        left: MAX_LAYERS,
        rounds: if tuner.per_input { ROUNDS } else { 0 },
        trials: Vec::new(),
        last: [None, None],
    };
    let best = search.candidates(seed)?;
    if best.error < ROUNDING * ROUNDING {
        return Ok(None);
    }
    let round = search.settle(&best)?;
    let seen = search.seen(best.ramps);
    let base = layer(tuner.most_neurons(data.rows()), seed);
    let best = Trial {
        neurons: base.neurons(),
        scale: round.scale,
        input_scales: round.column_scales.clone(),
        direct_links: true,
        score: best.error.sqrt(),
    };
    let params = tuner
        .params(&best)
        .with_distribution(base.distribution())
        .with_embedding(narrow(seen.embedding())?);
    search.trials.push(best.clone());
    Ok(Some(Choice {
        params,
        best,
        trials: search.trials,
    }))
}

/// Ramps of an input: fewer where there are many inputs of more than two values.
fn bins(x: &Array2<f64>) -> usize {
    let mut graded = 0;
    for column in x.columns() {
        let mut values = column.iter().filter(|v| **v != column[0]);
        if let Some(&second) = values.next()
            && values.any(|v| *v != second)
        {
            graded += 1;
        }
    }
    (COLUMNS / usize::max(graded, 1)).clamp(2, BINS)
}

fn narrow<A: Scalar>(embedding: Embedding<f64>) -> Result<Embedding<A>> {
    Ok(match embedding {
        Embedding::Ramps(ramps) => {
            let edges = (0..ramps.inputs()).map(|input| {
                let own = ramps.edges(input).iter();
                own.map(|&edge| A::from_f64(edge)).collect()
            });
            Embedding::Ramps(Ramps::new(edges.collect())?)
        }
        _ => Embedding::Inputs,
    })
}

/// The rounds of a path, each with the squared errors of the rows that it did not see.
type Rounds = Vec<(Round, Array1<f64>)>;

/// A path, walked.
struct Walked {
    found: Rounds,
    trials: Vec<Trial>,
    /// Layers tried.
    spent: usize,
}

/// The rows that are not `held`.
fn others(rows: usize, held: &[usize]) -> Vec<usize> {
    let mut is_held = vec![false; rows];
    held.iter().for_each(|&row| is_held[row] = true);
    (0..rows).filter(|&row| !is_held[row]).collect()
}

struct FullSearch {
    plain: Seen,
    embedded: Seen,
    neurons: usize,
    left: usize,
    rounds: usize,
    trials: Vec<Trial>,
    /// The rounds of the last path, without ramps and with.
    last: [Option<Vec<Round>>; 2],
}

impl FullSearch {
    fn seen(&self, ramps: bool) -> &Seen {
        if ramps { &self.embedded } else { &self.plain }
    }

    /// The structure and number of rounds that errors of rows held out choose.
    fn candidates(&mut self, seed: u64) -> Result<Candidate> {
        let rows = self.plain.x.nrows();
        let mut order: Vec<usize> = (0..rows).collect();
        order.shuffle(&mut Stream::Folds.of(seed));
        let folds: Vec<Vec<usize>> = if rows <= FEW_ROWS {
            (0..FOLDS)
                .map(|fold| order.iter().copied().skip(fold).step_by(FOLDS).collect())
                .collect()
        } else {
            vec![order[..rows / 4].to_vec()]
        };
        let ahead = self.look_ahead(&folds);
        let mut ahead = ahead.into_iter();
        let judged = folds.iter().map(Vec::len).sum::<usize>();
        let outputs = self.plain.targets.ncols() as f64;
        let mut candidates = Vec::new();
        for ramps in [false, true] {
            if ramps && !self.embedded.has_ramps() {
                continue;
            }
            let mut squares: Vec<Vec<f64>> = Vec::new();
            for held in &folds {
                let found = match ahead.next() {
                    Some(path) => self.take(path, ramps, held)?,
                    None => self.path(ramps, others(rows, held), self.rounds, held)?,
                };
                let Some(found) = found else { break };
                squares.resize(squares.len().max(found.len()), Vec::new());
                for ((_, own), squares) in found.iter().zip(&mut squares) {
                    squares.extend(self.weighted(held, own));
                }
                let rounds = found.into_iter().map(|(round, _)| round);
                self.last[usize::from(ramps)] = Some(rounds.collect());
            }
            let complete = squares.into_iter().take_while(|own| own.len() == judged);
            candidates.extend(complete.enumerate().map(|(round, squares)| Candidate {
                ramps,
                round,
                error: squares.iter().sum::<f64>() / (judged as f64 * outputs),
                squares,
            }));
        }
        Candidate::best(candidates).ok_or(crate::Error::NoConvergence {
            what: "the search for a weight scale",
        })
    }

    /// Walks the paths of [`candidates`](Self::candidates) on several threads, each as if it were the
    /// first; none where there is one thread.
    fn look_ahead(&self, folds: &[Vec<usize>]) -> Vec<Result<Walked>> {
        if threads::current_threads() == 1 {
            return Vec::new();
        }
        let rows = self.plain.x.nrows();
        let structures = [false, true].into_iter();
        let structures = structures.filter(|ramps| !ramps || self.embedded.has_ramps());
        let paths = structures.flat_map(|ramps| folds.iter().map(move |held| (ramps, held)));
        threads::map(paths.collect(), |(ramps, held): (bool, &Vec<usize>)| {
            self.walk(ramps, others(rows, held), self.rounds, held)
        })
    }

    /// A path that was walked ahead; again with what is left of the budget where it took more than that.
    fn take(
        &mut self,
        path: Result<Walked>,
        ramps: bool,
        held: &[usize],
    ) -> Result<Option<Rounds>> {
        match path {
            Ok(path) if path.spent <= self.left => Ok(Some(self.record(path))),
            _ => {
                let rows = self.plain.x.nrows();
                self.path(ramps, others(rows, held), self.rounds, held)
            }
        }
    }

    fn walk(&self, ramps: bool, kept: Vec<usize>, rounds: usize, held: &[usize]) -> Result<Walked> {
        let mut path = Path::new(self.seen(ramps), kept, self.neurons, self.left)?;
        let found = path.run(rounds, held)?;
        Ok(Walked {
            found,
            spent: self.left - path.left,
            trials: path.trials,
        })
    }

    fn record(&mut self, path: Walked) -> Rounds {
        self.left = self.left.saturating_sub(path.trials.len());
        self.trials.extend(path.trials);
        path.found
    }

    /// A path, or nothing once the budget is spent.
    fn path(
        &mut self,
        ramps: bool,
        kept: Vec<usize>,
        rounds: usize,
        held: &[usize],
    ) -> Result<Option<Rounds>> {
        if self.left == 0 {
            return Ok(None);
        }
        let walked = self.walk(ramps, kept, rounds, held)?;
        Ok(Some(self.record(walked)))
    }

    /// Squares whose mean is the weighted one.
    fn weighted(&self, held: &[usize], squares: &Array1<f64>) -> Array1<f64> {
        match &self.plain.weights {
            None => squares.clone(),
            Some(weights) => {
                let weights = weights.select(Axis(0), held);
                let mean = weights.sum() / weights.len() as f64;
                squares * &weights / mean
            }
        }
    }

    /// The round that was chosen: of three folds on all rows, else as the path of most rows left it.
    fn settle(&mut self, best: &Candidate) -> Result<Round> {
        let rows = self.plain.x.nrows();
        if rows <= FEW_ROWS {
            let all = (0..rows).collect();
            if let Some(found) = self.path(best.ramps, all, best.round, &[])?
                && let Some((round, _)) = found.into_iter().nth(best.round)
            {
                return Ok(round);
            }
        }
        let last = self.last[usize::from(best.ramps)].as_mut();
        let found = last.and_then(|rounds| rounds.get(best.round).cloned());
        found.ok_or(crate::Error::NoConvergence {
            what: "the search for a weight scale",
        })
    }
}

#[test]
fn another_number_of_rounds_is_taken_only_where_it_is_surely_better() {
    let of = |ramps, round, squares: [f64; 4]| Candidate {
        ramps,
        round,
        error: squares.iter().sum::<f64>() / 4.0,
        squares: squares.to_vec(),
    };
    let best = |others: [f64; 4]| {
        let candidates = vec![
            of(false, 0, others),
            of(true, 0, [2.0; 4]),
            of(true, 1, [1.0; 4]),
        ];
        let best = Candidate::best(candidates).unwrap();
        (best.ramps, best.round)
    };
    assert_eq!(best([0.9, 0.8, 0.9, 0.8]), (false, 0));
    // Better in the mean, by one row.
    assert_eq!(best([0.0, 1.1, 1.1, 1.1]), (true, 1));
    assert_eq!(best([0.999; 4]), (true, 1));
    // Nothing has ramps: the first is the usual one.
    assert!(!Candidate::best(vec![of(false, 0, [1.0; 4])]).unwrap().ramps);
    assert!(Candidate::best(Vec::new()).is_none());
}
