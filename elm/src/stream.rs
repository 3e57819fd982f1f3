//! The streams of random numbers that a seed has, so that no two uses share one.
//!
//! ```
//! use elm::advanced::Stream;
//!
//! let all = [Stream::Weights(0), Stream::Rows(0), Stream::Weights(1), Stream::Rows(1)];
//! let others = [Stream::Folds, Stream::SearchRows, Stream::Application(0), Stream::Application(1)];
//! let numbers = all.into_iter().chain(others).map(Stream::number);
//! assert_eq!(numbers.collect::<Vec<_>>(), [0, 2, 4, 6, 1, 3, 5, 7]);
//! ```

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What random numbers of a seed are used for. Each has a stream of its own: folds do not depend on the
/// weights, nor biases on rows on the choice of a distribution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// Weights and biases of a group of neurons, by its index in the layer.
    Weights(u32),
    /// Training rows that biases or centers of a group of neurons lie on.
    Rows(u32),
    /// Folds of a cross-validation.
    Folds,
    /// Rows that a search over settings looks at.
    SearchRows,
    /// Permutations of an input's values, by its index.
    Permutations(u32),
    /// Uses of a program's own, by a number that it gives each of them.
    Application(u32),
}

impl Stream {
    /// The number of the stream, for `set_stream` of a ChaCha generator.
    #[must_use]
    pub fn number(self) -> u64 {
        match self {
            Self::Weights(group) => 4 * u64::from(group),
            Self::Rows(group) => 4 * u64::from(group) + 2,
            Self::Folds => 1,
            Self::SearchRows => 3,
            // Above those of applications.
            Self::Permutations(input) => (1 << 40) + 2 * u64::from(input) + 1,
            Self::Application(number) => 2 * u64::from(number) + 5,
        }
    }

    /// The generator of this stream of a seed.
    pub(crate) fn of(self, seed: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(self.number());
        random
    }
}
