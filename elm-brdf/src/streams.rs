//! The streams of random numbers of this crate; folds have [`Stream::Folds`].

use elm::advanced::Stream;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Rows of a search, of many measurements.
pub(crate) const MANY: Stream = Stream::Application(0);
/// Rows of a search, of few measurements.
pub(crate) const FEW: Stream = Stream::Application(1);
/// Anchors.
pub(crate) const ANCHORS: Stream = Stream::Application(2);
/// Rows that judge a network.
pub(crate) const VALIDATION: Stream = Stream::Application(3);
/// Rows of the search for a compact network.
pub(crate) const COMPACT: Stream = Stream::Application(4);
/// Directions at which a small network is fitted to a large one.
pub(crate) const DISTILL: Stream = Stream::Application(6);
/// Rows that a method is given which cannot take all.
pub(crate) const SUBSAMPLE: Stream = Stream::Application(5);

/// The generator of a stream of a seed.
pub(crate) fn generator(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream.number());
    random
}
