// Builds template.html, or with --mode=sheet sheet_template.html: a whole page in one file, with a place for the data
// (client/cli/report_page.cc, report.cc).
import { readFileSync, writeFileSync } from 'node:fs';
import { defineConfig } from 'vite';

// Puts the scripts and styles of the page into the page, so that it loads no other file. A closing tag inside a script
// would end the script early.
function oneFile() {
  return {
    name: 'one-file',
    enforce: 'post',
    generateBundle(_, bundle) {
      const page = Object.values(bundle).find((file) => file.fileName.endsWith('.html'));
      let html = page.source;
      for (const [name, file] of Object.entries(bundle)) {
        if (file === page) continue;
        if (file.type === 'chunk') {
          const code = file.code.replaceAll('</script', '<\\/script').trim();
          html = html.replace(new RegExp(`\\s*<script[^>]*src="[^"]*${file.fileName}"[^>]*></script>`), '');
          html = html.replace('</body>', () => `<script type="module">${code}</script>\n</body>`);
        } else {
          html = html.replace(new RegExp(`\\s*<link[^>]*href="[^"]*${file.fileName}"[^>]*>`), () => `\n<style>${file.source.trim()}</style>`);
        }
        delete bundle[name];
      }
      page.source = html;
    },
  };
}

const out = process.env.PLANISH_REPORT_OUT ?? '.';

export default defineConfig(({ mode }) => {
  const [page, template] = mode === 'sheet' ? ['sheet.html', 'sheet_template.html'] : ['index.html', 'template.html'];
  return {
    base: './',
    build: {
      target: 'es2022',
      outDir: 'dist',
      assetsInlineLimit: 0,
      modulePreload: false,
      reportCompressedSize: false,
      rollupOptions: { input: page },
    },
    plugins: [
      oneFile(),
      {
        name: 'template',
        closeBundle() {
          writeFileSync(`${out}/${template}`, readFileSync(`dist/${page}`));
        },
      },
    ],
  };
});
