// Downloads with the token in the header: a plain link could not send it.
import { ApiError, type ApiClient } from '../api/client';
import { notify } from './notices';

export async function download(api: ApiClient, path: string, name: string): Promise<void> {
  try {
    const blob = await (await api.request(path)).blob();
    const url = URL.createObjectURL(blob);
    const link = document.createElement('a');
    link.href = url;
    link.download = name;
    document.body.append(link);
    link.click();
    link.remove();
    window.setTimeout(() => URL.revokeObjectURL(url), 60000);
  } catch (error) {
    notify(`${name} was not downloaded: ${error instanceof ApiError ? error.message : 'the transfer broke off'}`, 'error');
  }
}
