//! `elm scheduler`, `elm executor`, and sessions of a cluster. Experimental.

use std::collections::HashSet;
use std::future::Future;
use std::net::{SocketAddr, TcpListener};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use ballista::extension::SessionContextExt;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::{create_scheduler, start_grpc_service_with_listener};
use clap::Args;
use datafusion::arrow::array::{AsArray, RecordBatch};
use datafusion::arrow::datatypes::Int64Type;
use datafusion::common::ScalarValue;
use datafusion::execution::runtime_env::RuntimeEnv;
use datafusion::execution::{SessionState, SessionStateBuilder};
use datafusion::prelude::{SessionConfig, SessionContext};
use datafusion_proto::protobuf::{LogicalPlanNode, PhysicalPlanNode};
use elm_datafusion::cluster::{cluster_config, functions, logical_codec, physical_codec};

use crate::failure::Failure;
use crate::query::print;
use crate::{PARTITIONS, environment};

/// Bytes of a message: a plan holds a sample of the rows, and a state is at most some ten megabytes.
const MESSAGE: u32 = 256 << 20;
const PORT: u16 = 50050;
/// Seconds without a sign of life after which an executor is taken for dead.
const SILENCE: u64 = 10;

/// A cluster, instead of this process.
#[derive(Debug, Args)]
pub(crate) struct Cluster {
    /// Run on the Ballista cluster of this scheduler (experimental): HOST or HOST:PORT
    #[arg(long, value_name = "HOST:PORT")]
    cluster: Option<String>,
    /// Seconds after which work on a cluster is given up
    #[arg(long, default_value_t = 3600, requires = "cluster")]
    time_limit: u64,
}

impl Cluster {
    /// The session that plans run in: the cluster's, or the one given.
    pub(crate) async fn session(
        &self,
        embedded: &SessionContext,
    ) -> Result<SessionContext, Failure> {
        let Some(address) = &self.cluster else {
            return Ok(embedded.clone());
        };
        let (host, port) = reach(address).await?;
        let url = format!("df://{host}:{port}");
        let connected = SessionContext::remote_with_state(&url, state(config())?).await;
        let context = connected.map_err(|reason| Failure::at(address, Failure::from(reason)))?;
        let context = context.enable_url_table();
        elm_datafusion::register(&context)?;
        Ok(context)
    }

    pub(crate) fn is_used(&self) -> bool {
        self.cluster.is_some()
    }

    /// The result of work, or an error when the time for it is up.
    pub(crate) async fn within<T>(
        &self,
        work: impl Future<Output = Result<T, Failure>>,
    ) -> Result<T, Failure> {
        let Some(address) = &self.cluster else {
            return work.await;
        };
        let limit = Duration::from_secs(self.time_limit);
        match tokio::time::timeout(limit, work).await {
            Ok(result) => {
                result.map_err(|failure| Failure::at(format!("cluster {address}"), failure))
            }
            Err(_) => Err(Failure::at(
                format!("cluster {address}"),
                format!("no result within {} s (--time-limit)", self.time_limit),
            )),
        }
    }
}

/// The host and the port of a scheduler, or an error at once where there is none.
async fn reach(address: &str) -> Result<(&str, u16), Failure> {
    let (host, port) = match address.rsplit_once(':') {
        Some((host, port)) => (host, port.parse().ok()),
        None => (address, Some(PORT)),
    };
    let port = port.ok_or_else(|| Failure::at(address, "expected HOST or HOST:PORT"))?;
    let place = format!("no scheduler at {host}:{port}");
    let connected = tokio::net::TcpStream::connect((host, port));
    match tokio::time::timeout(Duration::from_secs(SILENCE), connected).await {
        Ok(Ok(_)) => Ok((host, port)),
        Ok(Err(reason)) => Err(Failure::at(place, reason)),
        Err(_) => Err(Failure::at(place, "no answer")),
    }
}

fn config() -> SessionConfig {
    cluster_config(PARTITIONS)
}

fn state(config: SessionConfig) -> datafusion::error::Result<SessionState> {
    Ok(SessionStateBuilder::new()
        .with_config(config)
        .with_runtime_env(environment()?)
        .with_default_features()
        .build())
}

/// Networks without the last column, which counts their rows. Refuses a group that is there twice, and other
/// rows than the first pass has seen: what a cluster can give whose executor died at the wrong moment.
pub(crate) fn checked(
    batches: Vec<RecordBatch>,
    groups: usize,
    expected: u64,
) -> Result<Vec<RecordBatch>, Failure> {
    let mut seen: HashSet<Vec<ScalarValue>> = HashSet::new();
    let mut rows = 0;
    let mut networks = Vec::with_capacity(batches.len());
    for batch in batches {
        let counts = batch.columns().last();
        let counts = counts.and_then(|counts| counts.as_primitive_opt::<Int64Type>());
        let counts = counts.ok_or_else(|| Failure::new("expected a count of rows"))?;
        rows += counts.values().iter().sum::<i64>();
        for row in 0..batch.num_rows() {
            let key: Result<Vec<_>, _> = (0..groups)
                .map(|column| ScalarValue::try_from_array(batch.column(column), row))
                .collect();
            if !seen.insert(key?) {
                return Err(Failure::new("a group came twice: nothing is written"));
            }
        }
        let kept: Vec<usize> = (0..batch.num_columns() - 1).collect();
        networks.push(batch.project(&kept)?);
    }
    if u64::try_from(rows).ok() != Some(expected) {
        return Err(Failure::new(format!(
            "networks of {rows} rows came back, and there are {expected}: nothing is written"
        )));
    }
    Ok(networks)
}

/// Arguments of `elm scheduler`.
#[derive(Debug, Args)]
pub(crate) struct Scheduler {
    /// The address to listen at
    #[arg(long, default_value = "127.0.0.1")]
    host: String,
    /// The port to listen at; 0 for a free one
    #[arg(long, default_value_t = PORT)]
    port: u16,
}

impl Scheduler {
    pub(crate) async fn run(self) -> Result<(), Failure> {
        let place = format!("{}:{}", self.host, self.port);
        let listener = tokio::net::TcpListener::bind(&place).await;
        let listener =
            listener.map_err(|reason| Failure::at(format!("cannot listen at {place}"), reason))?;
        let address = listener
            .local_addr()
            .map_err(|reason| Failure::at(&place, reason))?;
        let settings = SchedulerConfig {
            external_host: self.host,
            bind_host: address.ip().to_string(),
            bind_port: address.port(),
            scheduling_policy: TaskSchedulingPolicy::PullStaged,
            executor_timeout_seconds: SILENCE,
            expire_dead_executor_interval_seconds: 1,
            grpc_server_max_decoding_message_size: MESSAGE,
            grpc_server_max_encoding_message_size: MESSAGE,
            grpc_client_max_message_size: MESSAGE,
            override_config_producer: Some(Arc::new(config)),
            override_session_builder: Some(Arc::new(|config: SessionConfig| {
                let context = SessionContext::new_with_state(state(config)?);
                elm_datafusion::register_functions(&context);
                Ok(context.state())
            })),
            override_logical_codec: Some(logical_codec()),
            override_physical_codec: Some(physical_codec()),
            ..SchedulerConfig::default()
        };
        let failed = |reason: &dyn std::fmt::Display| Failure::at("scheduler", reason);
        let cluster = BallistaCluster::new_from_config(&settings);
        let cluster = cluster.await.map_err(|reason| failed(&reason))?;
        let scheduler =
            create_scheduler::<LogicalPlanNode, PhysicalPlanNode>(cluster, Arc::new(settings));
        let scheduler = scheduler.await.map_err(|reason| failed(&reason))?;
        print(&format!("scheduler at {address}"))?;
        let served = start_grpc_service_with_listener(listener, scheduler).await;
        served.map_err(|reason| failed(&reason))
    }
}

/// Arguments of `elm executor`.
#[derive(Debug, Args)]
pub(crate) struct Executor {
    /// The scheduler's address
    #[arg(long, default_value = "127.0.0.1:50050", value_name = "HOST:PORT")]
    scheduler: String,
    /// The address at which other executors reach this one
    #[arg(long, default_value = "127.0.0.1")]
    host: String,
}

impl Executor {
    pub(crate) async fn run(self, threads: NonZeroUsize) -> Result<(), Failure> {
        let (host, port) = reach(&self.scheduler).await?;
        let own = free_port(&self.host)?;
        let runtime: Arc<RuntimeEnv> = environment()?;
        // Results of other executors' work wait here. Gone when this process ends.
        let folder = tempfile::Builder::new().prefix("elm-executor-").tempdir();
        let folder = folder.map_err(|reason| Failure::at("no temporary folder", reason))?;
        let settings = ExecutorProcessConfig {
            bind_host: own.ip().to_string(),
            external_host: Some(self.host),
            port: own.port(),
            scheduler_host: host.to_owned(),
            scheduler_port: port,
            vcores: threads.get(),
            work_dir: Some(folder.path().to_string_lossy().into_owned()),
            task_scheduling_policy: TaskSchedulingPolicy::PullStaged,
            grpc_max_decoding_message_size: MESSAGE,
            grpc_max_encoding_message_size: MESSAGE,
            executor_heartbeat_interval_seconds: 1,
            override_function_registry: Some(Arc::new(functions())),
            override_runtime_producer: Some(Arc::new(move |_: &SessionConfig| {
                Ok(Arc::clone(&runtime))
            })),
            override_config_producer: Some(Arc::new(config)),
            override_logical_codec: Some(logical_codec()),
            override_physical_codec: Some(physical_codec()),
            ..ExecutorProcessConfig::default()
        };
        print(&format!("executor at {own} of {}", self.scheduler))?;
        let run = start_executor_process(Arc::new(settings)).await;
        run.map_err(|reason| Failure::at("executor", reason))
    }
}

/// A port that nobody listens at now.
fn free_port(host: &str) -> Result<SocketAddr, Failure> {
    let listener = TcpListener::bind((host, 0));
    let listener = listener.and_then(|listener| listener.local_addr());
    listener.map_err(|reason| Failure::at(format!("cannot listen at {host}"), reason))
}
