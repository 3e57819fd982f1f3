//! Least-squares problems that break linear algebra, and how every solver of `elm` fares on them.
//!
//! A [`Case`] makes a seeded [`Problem`]: rows to learn from and rows to be judged on, with noise
//! of the same size on both, as a user sees it. A problem of data goes through
//! [`ElmParams`](elm::ElmParams) for the default fit, [`Method::Auto`], and all other methods
//! solve on the hidden-layer matrix of that very network; a problem of a matrix gives the
//! hidden-layer matrix itself.
//!
//! Two measures, from code that shares nothing with `elm`:
//!
//! - the *ratio to the oracle* ([`oracle`]): the test RMSE over the smallest one that any strength
//!   of ridge regression, or the pseudo-inverse, has on the same hidden-layer matrix, found with
//!   the test rows in sight and computed in `f64`;
//! - the *error* ([`mod@reference`]): how far the predictions are from those of the same problem with
//!   the same strength, solved in double-double arithmetic (about 31 digits).

pub mod cases;
pub mod curve;
pub mod oracle;
pub mod reference;
pub mod report;
pub mod run;

pub use cases::{Case, Problem};
pub use run::{Method, Precision, Record, Settings, run};
