//! Classifiers in files.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{ClassAccumulator, ElmClassifier};
use crate::persist::{Error, Persist};
use crate::scalar::Scalar;

impl<A: Scalar, L: Ord + Serialize + DeserializeOwned> Persist for ElmClassifier<A, L> {
    const KIND: &'static str = "elm classifier";
    const SCALAR: &'static str = A::NAME;
    /// 100 times this layout's and the network's, which is part of it.
    const VERSION: u32 = 100 + <crate::Elm<A> as Persist>::VERSION;

    fn check(&self) -> Result<(), Error> {
        self.model.check()
    }
}

impl<A: Scalar, L: Ord + Clone + Serialize + DeserializeOwned> Persist for ClassAccumulator<A, L> {
    const KIND: &'static str = "elm classifier accumulator";
    const SCALAR: &'static str = A::NAME;
    /// 100 times this layout's and the accumulator's, which is part of it.
    const VERSION: u32 = 100 + <crate::Accumulator<A> as Persist>::VERSION;

    fn check(&self) -> Result<(), Error> {
        self.rows.check()
    }
}
