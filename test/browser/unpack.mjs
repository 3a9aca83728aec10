// Unpacks what the package has: into the folder for temporary files, as it does on its own.
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import chromium, { inflate } from '@sparticuz/chromium';

const packed = fileURLToPath(new URL('../bin', import.meta.resolve('@sparticuz/chromium')));
await chromium.executablePath();
// The libraries that a machine without a desktop has not; by itself the package takes them out
// only where it believes to be on one of Amazon's.
await inflate(join(packed, 'al2023.tar.br'));
console.log(tmpdir());
