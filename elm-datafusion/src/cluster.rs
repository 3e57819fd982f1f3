//! The functions on a Ballista cluster: how plans with them travel, and what its processes must know.

use std::fmt::Debug;
use std::sync::Arc;

use ballista_core::extension::SessionConfigExt;
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_core::serde::{BallistaLogicalExtensionCodec, BallistaPhysicalExtensionCodec};
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::catalog::TableProvider;
use datafusion::common::TableReference;
use datafusion::datasource::file_format::FileFormatFactory;
use datafusion::error::Result;
use datafusion::execution::TaskContext;
use datafusion::logical_expr::{AggregateUDF, Extension, LogicalPlan, ScalarUDF};
use datafusion::physical_plan::ExecutionPlan;
use datafusion::prelude::SessionConfig;
use datafusion_proto::logical_plan::LogicalExtensionCodec;
use datafusion_proto::physical_plan::{PhysicalExtensionCodec, PhysicalProtoConverterExtension};
use elm::persist::{self, Persist};
use serde::{Deserialize, Serialize};

use crate::columns::Nulls;
use crate::error::failed;
use crate::fit::ElmFit;
use crate::options::ElmOptions;
use crate::predict::ElmPredict;
use crate::sample::{ElmSample, Sample};
use crate::settings::Settings;
use crate::with_fixed_partitions;

/// A session's configuration for a client, a scheduler or an executor: plans with this package's functions
/// can be sent and read, rows are dealt to `partitions` as [`with_fixed_partitions`] says, and adaptive
/// planning is off, as it hangs when an executor dies.
#[must_use]
pub fn cluster_config(partitions: usize) -> SessionConfig {
    let mut config = with_fixed_partitions(SessionConfig::new_with_ballista(), partitions)
        .with_ballista_logical_extension_codec(logical_codec())
        .with_ballista_physical_extension_codec(physical_codec())
        .with_ballista_adaptive_query_planner(false);
    let extensions = &mut config.options_mut().extensions;
    extensions.insert(ElmOptions::default());
    config
}

/// How logical plans with this package's functions travel.
#[must_use]
pub fn logical_codec() -> Arc<dyn LogicalExtensionCodec> {
    Arc::new(Codec(BallistaLogicalExtensionCodec::default()))
}

/// How physical plans with this package's functions travel.
#[must_use]
pub fn physical_codec() -> Arc<dyn PhysicalExtensionCodec> {
    Arc::new(Codec(BallistaPhysicalExtensionCodec::default()))
}

/// An executor's functions: DataFusion's, and those of this package.
#[must_use]
pub fn functions() -> BallistaFunctionRegistry {
    let mut functions = BallistaFunctionRegistry::default();
    for function in [ElmFit::unbound().into(), ElmSample::unbound().into()] {
        let function: AggregateUDF = function;
        let name = function.name().to_owned();
        functions
            .aggregate_functions
            .insert(name, Arc::new(function));
    }
    for function in [ElmPredict::one(), ElmPredict::all()] {
        let function = ScalarUDF::from(function);
        let name = function.name().to_owned();
        functions.scalar_functions.insert(name, Arc::new(function));
    }
    functions
}

/// An aggregate with settings of its own, as bytes.
#[derive(Serialize, Deserialize)]
enum Bound {
    Fit(Box<Settings>, Option<Sample>),
    Sample(usize, bool, Nulls),
}

impl Persist for Bound {
    const KIND: &'static str = "elm call";
    const SCALAR: &'static str = "f64";
    const VERSION: u32 = 1;
}

/// Nothing where the function has no settings: its name says all.
fn encode(function: &AggregateUDF, bytes: &mut Vec<u8>) -> Result<()> {
    let inner: &dyn std::any::Any = function.inner().as_ref();
    let bound = if let Some(fit) = inner.downcast_ref::<ElmFit>() {
        fit.bound()
            .map(|(settings, sample)| Bound::Fit(Box::new(settings), sample))
    } else if let Some(sample) = inner.downcast_ref::<ElmSample>() {
        sample
            .bound()
            .map(|(leading, weighted, nulls)| Bound::Sample(leading, weighted, nulls))
    } else {
        None
    };
    if let Some(bound) = bound {
        let encoded = persist::to_bytes(&bound);
        bytes.extend(encoded.map_err(|error| failed(function.name(), error))?);
    }
    Ok(())
}

fn decode(name: &str, bytes: &[u8]) -> Result<Arc<AggregateUDF>> {
    let bound = persist::from_bytes(bytes).map_err(|error| failed(name, error))?;
    Ok(Arc::new(match bound {
        Bound::Fit(settings, sample) => ElmFit::new(*settings, sample).into(),
        Bound::Sample(leading, weighted, nulls) => ElmSample::new(leading, weighted, nulls).into(),
    }))
}

/// A codec of Ballista's that knows the aggregates, too.
#[derive(Debug)]
struct Codec<C>(C);

impl LogicalExtensionCodec for Codec<BallistaLogicalExtensionCodec> {
    fn try_decode(
        &self,
        bytes: &[u8],
        inputs: &[LogicalPlan],
        context: &TaskContext,
    ) -> Result<Extension> {
        self.0.try_decode(bytes, inputs, context)
    }

    fn try_encode(&self, node: &Extension, bytes: &mut Vec<u8>) -> Result<()> {
        self.0.try_encode(node, bytes)
    }

    fn try_decode_table_provider(
        &self,
        bytes: &[u8],
        table: &TableReference,
        schema: SchemaRef,
        context: &TaskContext,
    ) -> Result<Arc<dyn TableProvider>> {
        self.0
            .try_decode_table_provider(bytes, table, schema, context)
    }

    fn try_encode_table_provider(
        &self,
        table: &TableReference,
        node: Arc<dyn TableProvider>,
        bytes: &mut Vec<u8>,
    ) -> Result<()> {
        self.0.try_encode_table_provider(table, node, bytes)
    }

    fn try_decode_file_format(
        &self,
        bytes: &[u8],
        context: &TaskContext,
    ) -> Result<Arc<dyn FileFormatFactory>> {
        self.0.try_decode_file_format(bytes, context)
    }

    fn try_encode_file_format(
        &self,
        bytes: &mut Vec<u8>,
        node: Arc<dyn FileFormatFactory>,
    ) -> Result<()> {
        self.0.try_encode_file_format(bytes, node)
    }

    fn try_encode_udaf(&self, function: &AggregateUDF, bytes: &mut Vec<u8>) -> Result<()> {
        encode(function, bytes)
    }

    fn try_decode_udaf(&self, name: &str, bytes: &[u8]) -> Result<Arc<AggregateUDF>> {
        decode(name, bytes)
    }
}

impl PhysicalExtensionCodec for Codec<BallistaPhysicalExtensionCodec> {
    fn try_decode(
        &self,
        bytes: &[u8],
        inputs: &[Arc<dyn ExecutionPlan>],
        context: &TaskContext,
        converter: &dyn PhysicalProtoConverterExtension,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        self.0.try_decode(bytes, inputs, context, converter)
    }

    fn try_encode(
        &self,
        node: Arc<dyn ExecutionPlan>,
        bytes: &mut Vec<u8>,
        converter: &dyn PhysicalProtoConverterExtension,
    ) -> Result<()> {
        self.0.try_encode(node, bytes, converter)
    }

    fn try_encode_udaf(&self, function: &AggregateUDF, bytes: &mut Vec<u8>) -> Result<()> {
        encode(function, bytes)
    }

    fn try_decode_udaf(&self, name: &str, bytes: &[u8]) -> Result<Arc<AggregateUDF>> {
        decode(name, bytes)
    }
}
