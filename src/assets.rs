//! Where asset files are: robots that come with the crate, or a folder of yours.

use std::path::{Path, PathBuf};

/// An asset was not found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssetMissing {
    /// The path asked for.
    pub asset: PathBuf,
    /// Every place that was tried.
    pub tried: Vec<PathBuf>,
}

impl std::fmt::Display for AssetMissing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "asset {} is not there; tried ", self.asset.display())?;
        for (i, place) in self.tried.iter().enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{}", place.display())?;
        }
        write!(f, "; set KINETOSCOPE_ASSETS to the folder that holds it")
    }
}

impl std::error::Error for AssetMissing {}

/// The file of an asset such as `sr5/SR5.urdf`: an absolute path as it is, else below the folder `KINETOSCOPE_ASSETS`,
/// else below the folder that comes with this crate.
///
/// # Errors
/// It is in none of these places; the error lists them.
pub fn path(asset: impl AsRef<Path>) -> Result<PathBuf, AssetMissing> {
    resolve(asset.as_ref(), std::env::var_os("KINETOSCOPE_ASSETS").map(PathBuf::from))
}

fn resolve(asset: &Path, own: Option<PathBuf>) -> Result<PathBuf, AssetMissing> {
    let tried: Vec<PathBuf> = if asset.is_absolute() {
        vec![asset.to_path_buf()]
    } else {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
        own.into_iter().chain([shipped]).map(|folder| folder.join(asset)).collect()
    };
    match tried.iter().find(|place| place.exists()) {
        Some(place) => Ok(place.clone()),
        None => Err(AssetMissing { asset: asset.to_path_buf(), tried }),
    }
}
