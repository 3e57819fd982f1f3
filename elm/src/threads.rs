//! Work on several threads, cut into parts that depend on the work alone, so that no digit of a result
//! depends on how many threads there are.
//!
//! Work goes to rayon's current pool: all cores, unless the program says otherwise or calls from a pool of
//! its own (`pool.install(|| params.fit(&x, &t))`). Small problems stay on the thread that asks.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ndarray::Array2;

use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// Multiplications below which a part is not worth handing to another thread.
pub(crate) const WORTHWHILE: usize = 1 << 20;

#[cfg(feature = "rayon")]
mod limit {
    use std::cell::Cell;

    thread_local! {
        static ALONE: Cell<bool> = const { Cell::new(false) };
    }

    /// Whether this thread is to do its work by itself.
    pub(super) fn alone() -> bool {
        ALONE.get()
    }

    /// Puts the mark back when it is dropped, after a panic as well.
    pub(super) struct Alone(bool);

    impl Alone {
        pub(super) fn begin() -> Self {
            Self(ALONE.replace(true))
        }
    }

    impl Drop for Alone {
        fn drop(&mut self) {
            ALONE.set(self.0);
        }
    }
}

/// Runs `work`, and whatever of this crate it calls, on the thread that asks.
///
/// For code that holds a lock, or runs on a pool's worker by itself: a worker that waits for others takes up
/// other work of its pool meanwhile, whatever that may be.
pub fn on_this_thread<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(feature = "rayon")]
    let _alone = limit::Alone::begin();
    work()
}

/// Runs `work`, and whatever of this crate it calls, on this number of threads in place of rayon's current
/// pool. Results are the same bits for any number.
///
/// One thread is the caller's own, and no pool is made for it. Without the feature `rayon` everything runs on
/// the caller's thread.
///
/// ```
/// use elm::{ElmParams, on_threads};
/// use ndarray::{Array2, Axis};
///
/// let x = Array2::from_shape_fn((4000, 4), |(i, j)| (i * (j + 2)) as f64 % 7.3);
/// let t = x.map_axis(Axis(1), |row| row[0] * row[1]);
/// let params = ElmParams::new(100);
/// let one = on_threads(1, || params.fit(&x, &t))??;
/// let two = on_threads(2, || params.fit(&x, &t))??;
/// assert_eq!(one, two);
/// # Ok::<(), elm::Error>(())
/// ```
///
/// # Errors
/// [`Error::Parameter`] for no threads, or more than the system gives.
#[doc(alias = "n_jobs")]
pub fn on_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> Result<R> {
    let refused = |expected| Error::Parameter {
        name: "threads",
        value: threads as f64,
        expected,
    };
    if threads == 0 {
        return Err(refused("at least 1"));
    }
    if threads == 1 {
        return Ok(on_this_thread(work));
    }
    #[cfg(feature = "rayon")]
    {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            // What a main thread has; a layer of a few thousand neurons needs a part of it.
            .stack_size(8 << 20)
            .build()
            .map_err(|_| refused("as many as the system gives"))?;
        Ok(pool.install(work))
    }
    #[cfg(not(feature = "rayon"))]
    Ok(work())
}

/// The number of threads that a call from here would be shared among.
#[must_use]
pub fn current_threads() -> usize {
    #[cfg(feature = "rayon")]
    if !limit::alone() {
        return rayon::current_num_threads();
    }
    1
}

/// What becomes of each item, in their order; items are shared among the threads that a call from here has
/// (see [`on_threads`](crate::on_threads)).
///
/// ```
/// use elm::advanced::parallel_map;
/// assert_eq!(parallel_map(vec![1, 2, 3], |n| n * n), [1, 4, 9]);
/// ```
pub fn map<I: Send, R: Send>(items: Vec<I>, work: impl Fn(I) -> R + Sync) -> Vec<R> {
    map_with(items, || (), |(), item| work(item))
}

/// As [`map`], with working memory that items on one thread share.
pub(crate) fn map_with<I: Send, S, R: Send>(
    items: Vec<I>,
    memory: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, I) -> R + Sync,
) -> Vec<R> {
    #[cfg(feature = "rayon")]
    if items.len() > 1 && current_threads() > 1 {
        use rayon::prelude::*;
        let items = items.into_par_iter().with_max_len(1);
        return items.map_init(&memory, &work).collect();
    }
    let mut memory = memory();
    let items = items.into_iter();
    items.map(|item| work(&mut memory, item)).collect()
}

/// What becomes of the items, the first with each other in turn, in their order; nothing of none.
///
/// # Errors
/// The first of `work`.
pub(crate) fn reduce<I: Send, R: Send>(
    items: Vec<I>,
    work: impl Fn(I) -> Result<R> + Sync,
    mut merge: impl FnMut(&mut R, R),
) -> Result<Option<R>> {
    let mut all: Option<R> = None;
    let mut add = |part: R| match &mut all {
        Some(all) => merge(all, part),
        none => *none = Some(part),
    };
    if current_threads() > 1 {
        map(items, work)
            .into_iter()
            .try_for_each(|part| part.map(&mut add))?;
    } else {
        // One part at a time is enough.
        items
            .into_iter()
            .try_for_each(|item| work(item).map(&mut add))?;
    }
    Ok(all)
}

/// The sum of what `work` adds to zeros for each item, in their order; nothing of none.
///
/// Each thread takes the next item, and room that an earlier sum has left: new pages for every item would
/// take longer than small sums.
///
/// # Errors
/// The first of `work`.
pub(crate) fn sum<I: Send, S, A: Scalar>(
    items: Vec<I>,
    zeros: impl Fn() -> Array2<A> + Sync,
    memory: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, I, &mut Array2<A>) -> Result<()> + Sync,
) -> Result<Option<Array2<A>>> {
    let workers = current_threads().min(items.len());
    let rest = Mutex::new(items.into_iter().enumerate());
    let sums = Mutex::new(Sums::default());
    map(vec![(); workers], |()| {
        let mut memory = memory();
        loop {
            let Some((number, item)) = locked(&rest).next() else {
                return;
            };
            let mut known = locked(&sums);
            if known.failed.is_some() {
                return;
            }
            let room = known.free.pop();
            drop(known);
            let mut part = room.map_or_else(&zeros, |mut part| {
                part.fill(A::zero());
                part
            });
            let added = work(&mut memory, item, &mut part).map(|()| part);
            locked(&sums).add(number, added);
        }
    });
    let sums = sums.into_inner().unwrap_or_else(PoisonError::into_inner);
    match sums.failed {
        Some((_, error)) => Err(error),
        None => Ok(sums.all),
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A sum of parts that come in any order.
struct Sums<A: Scalar> {
    /// The sum of the first `count` parts.
    all: Option<Array2<A>>,
    count: usize,
    /// Parts that wait for earlier ones.
    early: BTreeMap<usize, Array2<A>>,
    free: Vec<Array2<A>>,
    failed: Option<(usize, Error)>,
}

impl<A: Scalar> Default for Sums<A> {
    fn default() -> Self {
        Self {
            all: None,
            count: 0,
            early: BTreeMap::new(),
            free: Vec::new(),
            failed: None,
        }
    }
}

impl<A: Scalar> Sums<A> {
    fn add(&mut self, number: usize, part: Result<Array2<A>>) {
        match part {
            Ok(part) => {
                self.early.insert(number, part);
            }
            Err(error) => {
                if self
                    .failed
                    .as_ref()
                    .is_none_or(|(first, _)| number < *first)
                {
                    self.failed = Some((number, error));
                }
            }
        }
        while let Some(part) = self.early.remove(&self.count) {
            self.count += 1;
            match &mut self.all {
                Some(all) => {
                    *all += &part;
                    self.free.push(part);
                }
                none => *none = Some(part),
            }
        }
    }
}

/// Bounds of up to `parts` parts of about the same number of items.
pub(crate) fn split(items: usize, parts: usize) -> Vec<std::ops::Range<usize>> {
    let parts = parts.clamp(1, items.max(1));
    (0..parts)
        .map(|part| items * part / parts..items * (part + 1) / parts)
        .collect()
}

#[cfg(all(test, feature = "rayon"))]
mod tests {
    use super::*;

    #[test]
    fn parts_keep_their_order_and_cover_everything() {
        for (items, parts) in [(0, 4), (1, 4), (10, 3), (7, 7), (1000, 16)] {
            let ranges = split(items, parts);
            assert!(ranges.len() <= parts);
            let all: Vec<usize> = ranges.into_iter().flatten().collect();
            assert_eq!(all, (0..items).collect::<Vec<_>>());
        }
        for threads in 1..4 {
            let squares = on_threads(threads, || map((0..100).collect(), |i: usize| i * i));
            assert_eq!(
                squares.unwrap(),
                (0..100).map(|i| i * i).collect::<Vec<_>>()
            );
        }
    }

    #[test]
    fn sums_are_the_same_bits_and_the_first_error_is_told() {
        let sum_of = |threads, from: usize| {
            on_threads(threads, || {
                sum(
                    (0..40).collect(),
                    || Array2::<f64>::zeros((3, 2)),
                    || (),
                    |(), item: usize, sum| {
                        if item >= from {
                            return Err(Error::Parameter {
                                name: "item",
                                value: item as f64,
                                expected: "less",
                            });
                        }
                        *sum += 1.0 / (1.0 + item as f64);
                        Ok(())
                    },
                )
            })
            .unwrap()
        };
        let alone = sum_of(1, 99).unwrap();
        for threads in 1..5 {
            assert_eq!(sum_of(threads, 99).unwrap(), alone);
            let error = sum_of(threads, 7).unwrap_err();
            assert!(error.to_string().contains('7'), "{error}");
        }
    }

    #[test]
    fn the_number_of_threads_is_what_was_asked_for_and_comes_back() {
        let before = current_threads();
        for threads in 1..4 {
            assert_eq!(on_threads(threads, current_threads).unwrap(), threads);
        }
        assert_eq!(
            on_threads(3, || on_threads(1, current_threads).unwrap()).unwrap(),
            1
        );
        assert_eq!(
            on_threads(1, || on_threads(2, current_threads).unwrap()).unwrap(),
            2
        );
        assert_eq!(current_threads(), before);
        assert!(on_threads(0, || ()).is_err());
    }
}
