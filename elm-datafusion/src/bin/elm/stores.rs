//! Files at URLs: in stores of objects and on servers of files.

use std::sync::Arc;

use datafusion::datasource::listing::ListingTableUrl;
use datafusion::error::{DataFusionError, Result};
use datafusion::execution::object_store::{DefaultObjectStoreRegistry, ObjectStoreRegistry};
use datafusion::prelude::SessionContext;
use futures::TryStreamExt;
use glob::{MatchOptions, Pattern};
use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::http::HttpBuilder;
use object_store::path::Path;
use object_store::{ClientOptions, ObjectStore};
use url::{Position, Url};

use crate::failure::Failure;

/// Opens a store when its first URL is met. Access is set by each provider's own variables of the
/// environment, such as `AWS_ACCESS_KEY_ID` and `AWS_ENDPOINT`.
#[derive(Debug, Default)]
pub(crate) struct Stores(DefaultObjectStoreRegistry);

impl ObjectStoreRegistry for Stores {
    fn register_store(
        &self,
        url: &Url,
        store: Arc<dyn ObjectStore>,
    ) -> Option<Arc<dyn ObjectStore>> {
        self.0.register_store(url, store)
    }

    fn get_store(&self, url: &Url) -> Result<Arc<dyn ObjectStore>> {
        if let Ok(store) = self.0.get_store(url) {
            return Ok(store);
        }
        let store = open(url)?;
        self.0.register_store(url, Arc::clone(&store));
        Ok(store)
    }
}

fn open(url: &Url) -> Result<Arc<dyn ObjectStore>> {
    let root = &url[..Position::BeforePath];
    Ok(match url.scheme() {
        "s3" | "s3a" => Arc::new(AmazonS3Builder::from_env().with_url(root).build()?),
        "gs" => Arc::new(
            GoogleCloudStorageBuilder::from_env()
                .with_url(root)
                .build()?,
        ),
        "az" | "adl" | "azure" | "abfs" | "abfss" => {
            Arc::new(MicrosoftAzureBuilder::from_env().with_url(root).build()?)
        }
        "http" | "https" => {
            let options = ClientOptions::new().with_allow_http(url.scheme() == "http");
            let store = HttpBuilder::new().with_url(root);
            Arc::new(store.with_client_options(options).build()?)
        }
        other => {
            return Err(DataFusionError::Execution(format!(
                "no store for '{other}://'; expected s3, gs, az, abfs, http or https"
            )));
        }
    })
}

/// Whether a name is a URL and not a path.
pub(crate) fn is_url(name: &str) -> bool {
    name.contains("://")
}

/// The files that a URL stands for, which may hold a pattern, in order.
pub(crate) async fn list(context: &SessionContext, url: &str) -> Result<Vec<String>, Failure> {
    let at = |reason: DataFusionError| Failure::at(url, Failure::from(reason));
    if url.contains('?') {
        return Err(Failure::at(url, "expected a URL without '?'"));
    }
    let root = ListingTableUrl::parse(url).map_err(at)?;
    let root = root.object_store();
    let Some(first) = url.find(['*', '[']) else {
        return Ok(vec![url.to_owned()]);
    };
    let store = context.runtime_env().object_store(&root);
    let store = store.map_err(at)?;
    let path = url.strip_prefix(root.as_str());
    let path = path.ok_or_else(|| Failure::at(url, format!("expected {root}...")))?;
    let pattern = Pattern::new(path).map_err(|reason| Failure::at(url, reason))?;
    let options = MatchOptions {
        require_literal_separator: true,
        ..MatchOptions::new()
    };
    let fixed = &path[..first - root.as_str().len()];
    let folder = fixed.rfind('/').map(|end| Path::from(&fixed[..end]));
    let found: Vec<_> = store
        .list(folder.as_ref())
        .try_collect()
        .await
        .map_err(|reason| at(reason.into()))?;
    let found = found.into_iter().map(|file| file.location.to_string());
    let mut files: Vec<String> = found
        .filter(|path| pattern.matches_with(path, options))
        .map(|path| format!("{root}{path}"))
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(Failure::at(url, "no such file"));
    }
    Ok(files)
}
