//! Networks with their uncertainty in files.

use super::CompactUncertainElm;
use crate::dataset::TargetDim;
use crate::persist::{Error, Persist};
use crate::scalar::Scalar;

impl<A: Scalar, D: TargetDim> Persist for CompactUncertainElm<A, D> {
    const KIND: &'static str = "elm model with uncertainty";
    const SCALAR: &'static str = A::NAME;
    /// 100 times this layout's and the network's, which is part of it.
    const VERSION: u32 = 100 + <crate::Elm<A> as Persist>::VERSION;

    fn check(&self) -> Result<(), Error> {
        self.model.check()?;
        self.members
            .iter()
            .try_for_each(|member| member.model.check())
    }
}
