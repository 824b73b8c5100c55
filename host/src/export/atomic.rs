//! Files that appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::error::{ExportError, ExportErrorKind};

/// A file under construction: bytes go to a temporary file in the same folder, which takes the
/// final name in [`AtomicFile::commit`].
///
/// Dropped without a commit, it removes the temporary file; an older file of the final name stays
/// as it was. A symbolic link is followed. Devices and pipes (`/dev/null`) cannot be replaced and
/// are written directly.
pub struct AtomicFile {
    /// As the caller named it, for messages.
    path: PathBuf,
    /// Where the bytes go.
    writer: Option<BufWriter<File>>,
    /// Absent for devices and pipes.
    rename: Option<Rename>,
}

struct Rename {
    temporary: PathBuf,
    target: PathBuf,
}

impl AtomicFile {
    /// Opens the temporary file for `path`.
    ///
    /// # Errors
    /// The folder is missing or may not be written to, or `path` is a folder.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, ExportError> {
        let path = path.as_ref().to_owned();
        match Self::open(&path) {
            Ok((file, rename)) => Ok(Self {
                path,
                writer: Some(BufWriter::with_capacity(1 << 16, file)),
                rename,
            }),
            Err(kind) => Err(kind.at(path)),
        }
    }

    fn open(path: &Path) -> Result<(File, Option<Rename>), ExportErrorKind> {
        // Following links first keeps a link a link: only the file behind it is replaced.
        let target = match fs::canonicalize(path) {
            Ok(target) => {
                let kind = fs::metadata(&target)?.file_type();
                if kind.is_dir() {
                    return Err(ExportErrorKind::IsFolder);
                }
                if !kind.is_file() {
                    return Ok((OpenOptions::new().write(true).open(&target)?, None));
                }
                target
            }
            Err(_) => path.to_owned(),
        };
        let Some(name) = target.file_name() else {
            return Err(ExportErrorKind::IsFolder);
        };
        let folder = target.parent().unwrap_or(Path::new(""));
        // A process-wide count tells apart threads; the process number tells apart programs; a
        // leftover of a killed program with the same number is stepped over.
        static COUNT: AtomicU64 = AtomicU64::new(0);
        loop {
            let mut temporary = std::ffi::OsString::from(".");
            temporary.push(name);
            temporary.push(format!(
                ".{}-{}.tmp",
                std::process::id(),
                COUNT.fetch_add(1, Ordering::Relaxed)
            ));
            let temporary = folder.join(temporary);
            match OpenOptions::new().write(true).create_new(true).open(&temporary) {
                Ok(file) => return Ok((file, Some(Rename { temporary, target }))),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Flushes to the disk and gives the file its final name.
    ///
    /// # Errors
    /// The disk is full or refuses; then nothing is left behind.
    pub fn commit(mut self) -> Result<(), ExportError> {
        self.publish()
            .map_err(|error| ExportErrorKind::from(error).at(&self.path))
    }

    fn publish(&mut self) -> io::Result<()> {
        let Some(writer) = self.writer.take() else {
            return Ok(());
        };
        let file = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        let Some(Rename { temporary, target }) = &self.rename else {
            return Ok(());
        };
        file.sync_all()?;
        drop(file);
        // Keeps the access rights that a replaced file had; a new file has the user's default.
        if let Ok(old) = fs::metadata(target) {
            fs::set_permissions(temporary, old.permissions())?;
        }
        fs::rename(temporary, target)?;
        // The new name survives a power cut only once the folder is on the disk too; not every
        // system lets a folder be opened, and the file itself is safe by now.
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
            let _ = folder.sync_all();
        }
        self.rename = None;
        Ok(())
    }

    /// The path as the caller named it.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.writer {
            Some(writer) => writer.write(bytes),
            None => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.writer {
            Some(writer) => writer.flush(),
            None => Ok(()),
        }
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some(Rename { temporary, .. }) = &self.rename {
            if let Some(writer) = self.writer.take() {
                // The buffered rest is not wanted any more.
                let _ = writer.into_parts();
            }
            let _ = fs::remove_file(temporary);
        }
    }
}

/// Writes a whole file: `write` fills it, and it appears under `path` only if `write` succeeds.
///
/// # Errors
/// What `write` returns, or what the file system reports, with the file named.
pub fn write_atomic(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> Result<(), ExportErrorKind>,
) -> Result<(), ExportError> {
    let mut file = AtomicFile::create(path)?;
    match write(&mut file) {
        Ok(()) => file.commit(),
        Err(kind) => Err(kind.at(file.path())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::test_folder::TestFolder;

    #[test]
    fn success_replaces_and_leaves_no_temporary() {
        let folder = TestFolder::new();
        let path = folder.path("a.bin");
        for text in ["first", "second"] {
            write_atomic(&path, |out| Ok(out.write_all(text.as_bytes())?)).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
            assert_eq!(folder.names(), ["a.bin"]);
        }
    }

    #[test]
    fn failure_keeps_the_old_file_and_leaves_no_temporary() {
        let folder = TestFolder::new();
        let path = folder.path("a.bin");
        fs::write(&path, "old").unwrap();
        let error = write_atomic(&path, |out| {
            out.write_all(&[0; 200_000])?;
            Err(ExportErrorKind::NotFinite {
                what: "vertex 3".into(),
            })
        })
        .unwrap_err();
        assert!(error.to_string().ends_with(
            "a.bin: vertex 3 is not finite; repair the input: fill its gaps, remove NaN and infinity"
        ));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(folder.names(), ["a.bin"]);
    }

    #[test]
    fn dropped_without_commit_leaves_nothing() {
        let folder = TestFolder::new();
        let mut file = AtomicFile::create(folder.path("b.bin")).unwrap();
        file.write_all(b"half").unwrap();
        assert_eq!(folder.names().len(), 1, "the temporary file is beside it");
        drop(file);
        assert!(folder.names().is_empty());
    }

    #[test]
    fn two_writers_of_one_name_do_not_mix() {
        let folder = TestFolder::new();
        let path = folder.path("c.bin");
        let mut one = AtomicFile::create(&path).unwrap();
        let mut two = AtomicFile::create(&path).unwrap();
        one.write_all(b"one").unwrap();
        two.write_all(b"two").unwrap();
        two.commit().unwrap();
        one.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"one");
        assert_eq!(folder.names(), ["c.bin"]);
    }

    #[test]
    fn missing_folder_and_folder_as_file_are_told_apart() {
        let folder = TestFolder::new();
        let kind = |path: PathBuf| AtomicFile::create(path).err().unwrap().kind;
        assert_eq!(kind(folder.path("no/a.bin")), ExportErrorKind::NoFolder);
        assert_eq!(kind(folder.path(".")), ExportErrorKind::IsFolder);
        assert_eq!(kind(PathBuf::from("..")), ExportErrorKind::IsFolder);
        assert_eq!(kind(PathBuf::new()), ExportErrorKind::IsFolder);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_devices_written_and_rights_kept() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = TestFolder::new();
        fs::write(folder.path("real"), "old").unwrap();
        fs::set_permissions(folder.path("real"), fs::Permissions::from_mode(0o640)).unwrap();
        symlink(folder.path("real"), folder.path("link")).unwrap();
        write_atomic(folder.path("link"), |out| Ok(out.write_all(b"new")?)).unwrap();
        assert_eq!(fs::read(folder.path("real")).unwrap(), b"new");
        assert!(fs::symlink_metadata(folder.path("link")).unwrap().is_symlink());
        let mode = fs::metadata(folder.path("real")).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640);

        write_atomic("/dev/null", |out| Ok(out.write_all(b"gone")?)).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_named() {
        let error = write_atomic("/dev/full", |out| Ok(out.write_all(b"x")?)).unwrap_err();
        assert_eq!(error.kind, ExportErrorKind::DiskFull);
    }
}
